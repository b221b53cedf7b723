"""Backend `onnx`: the masks of an ONNX network with classes of the vocabulary."""

from __future__ import annotations

from scenewright.stages.segment.choice import BackendRequest
from scenewright.stages.segment.networks.pictures import PictureBackend, open_pictures


def open_backend(request: BackendRequest) -> PictureBackend:
    """Return the backend that the request asks for. Raises as `open_pictures` does."""
    return open_pictures("onnx", request)
