"""Depth in OpenEXR files, as phones and renderers write it: one channel of half or single floats. Needs OpenEXR."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterable
from types import ModuleType

import numpy as np
from scenewright.stages.ingest.source import Unusable
from scenewright.stages.kit.formats.image_headers import LARGEST_IMAGE
from scenewright.stages.kit.needed import needed

EXR_SUFFIX = ".exr"
CHANNELS = ("Z", "R", "Y")
"""Which of several channels is depth; a lone channel is, whatever it is called."""


def require_exr(names: Iterable[str]) -> None:
    """Raise MissingDependency, before any frame is read, when depth is in OpenEXR files and nothing here reads them."""
    if any(name.lower().endswith(EXR_SUFFIX) for name in names):
        _openexr()


def exr_depth(data: bytes) -> np.ndarray:
    """Return the depth (H, W) float32 in the bytes of an OpenEXR file. Raises Unusable, MissingDependency."""
    library = _openexr()
    left, top, right, bottom = np.reshape(_read(library, data, header_only=True).header()["dataWindow"], 4).tolist()
    width, height = right - left + 1, bottom - top + 1
    if not (width > 0 and height > 0 and width * height <= LARGEST_IMAGE):
        raise Unusable("undecodable_depth", f"OpenEXR image of {width}x{height} pixels")
    channels = _read(library, data, header_only=False).channels()
    name = next(iter(channels)) if len(channels) == 1 else next((name for name in CHANNELS if name in channels), None)
    if name is None:
        raise Unusable("undecodable_depth", f"OpenEXR channels {', '.join(sorted(channels))[:60]}: none is Z, R or Y")
    pixels = channels[name].pixels
    if pixels.shape != (height, width) or pixels.dtype not in (np.float16, np.float32):
        raise Unusable("undecodable_depth", f"OpenEXR channel {name} of shape {pixels.shape}, {pixels.dtype}")
    return pixels.astype(np.float32)


def _openexr() -> ModuleType:
    return needed("OpenEXR", "depth in .exr files", extra="phone")


def _read(library: ModuleType, data: bytes, *, header_only: bool):  # type: ignore[no-untyped-def]
    """Return an `OpenEXR.File` with a part. Raises Unusable for damaged bytes, of which the library prints things."""
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            file = library.File(io.BytesIO(data), separate_channels=True, header_only=header_only, num_threads=0)
            file.header()
    except (RuntimeError, ValueError, TypeError, MemoryError):
        raise Unusable("undecodable_depth", f"damaged OpenEXR file of {len(data)} bytes") from None
    return file
