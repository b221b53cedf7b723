"""What decides the masks beside the code, for the backends that need it: the versions that go into the key."""

from __future__ import annotations

from stages.kit.library_versions import library_version
from stages.segment.backend_names import is_service
from stages.segment.parameters import SegmentParameters

LIBRARIES = {
    "huggingface": ("transformers", "torch", "tokenizers", "pillow"),
    "onnx": ("onnxruntime",),
    "network": ("torch",),
    "auto": ("torch",),
}
"""Backend -> distributions that it alone needs."""


def versions(parameters: SegmentParameters) -> dict[str, str]:
    """Return name -> version. Of a service, what it says of itself now, or what --service-model says it has to be.

    Raises MissingDependency when the service does not answer, BadInput when it is none.
    """
    if not is_service(parameters.backend):
        return {name: library_version(name) for name in LIBRARIES.get(parameters.backend, ())}
    # Imported here: only this backend needs it.
    from stages.segment.service.identity import service_identity

    name = f"service {parameters.backend}"
    if parameters.service_model:
        return {name: parameters.service_model}
    return {
        name: service_identity(
            parameters.backend,
            timeout=parameters.request_timeout,
            retries=parameters.retries,
            retry_wait=parameters.retry_wait,
        )
    }
