"""The names that `scenewright segment --backend` knows, and what stands behind each. Cheap to import."""

from __future__ import annotations

from difflib import get_close_matches

from stages.kit.services.address import check_address

BACKENDS = {
    "ground-truth": "the log's own labels",
    "geometric": "every geometric segment is an `object`",
    "objects": "whole objects from geometry and colour, each an `object`",
    "detector": "an ONNX object detector and the depth",
    "network": "a compact RGB-D network of our own, trained on generated rooms",
    "auto": "what needs nothing installed and nothing known of the log: `network`",
    "huggingface": "a panoptic or open-vocabulary model of the transformers library",
    "onnx": "an ONNX instance or panoptic network",
}
"""Name -> where its masks come from. `http://HOST:PORT` of a segmentation service is the ninth."""
LABEL_FILES = ("labels/coco_panoptic.toml", "labels/ade20k.toml", "labels/words.toml")
"""Files of data/ that say what the labels of networks stand for."""
SERVICE = "http://HOST:PORT of a segmentation service"


def is_service(backend: str) -> bool:
    """Whether a backend is the address of a segmentation service (docs/SEGMENTATION.md)."""
    return backend.startswith(("http://", "https://"))


def check_backend(backend: str) -> str:
    """Return the name of a backend, or the address of a service without its closing slash. Raises ValueError."""
    if backend in BACKENDS:
        return backend
    if is_service(backend):
        return check_address(backend, form=SERVICE)
    close = get_close_matches(backend, BACKENDS, n=1)
    guess = f"did you mean {close[0]}? " if close else ""
    raise ValueError(f"no such backend; {guess}one of {', '.join(BACKENDS)}, {SERVICE}")
