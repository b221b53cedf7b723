"""What goes into an ONNX network and what comes out: said by a TOML beside it, or found out from its outputs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from pydantic import ValidationError
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput, first_problem
from scenewright.schemas.outside import file_toml

Layout = Literal["yolo-seg", "instances", "panoptic"]
LARGEST_FILE = 2**20
"""Most bytes of a sidecar."""
OUTPUTS: Mapping[str, tuple[str, ...]] = {
    "yolo-seg": ("predictions", "prototypes"),
    "instances": ("boxes", "labels", "scores", "masks"),
    "panoptic": ("classes", "masks"),
}
"""Layout -> roles of its outputs."""
KNOWN_NAMES = {
    "boxes": "boxes",
    "labels": "labels",
    "scores": "scores",
    "masks": "masks",
    "pred_boxes": "boxes",
    "pred_classes": "labels",
    "pred_masks": "masks",
}
"""Names of outputs in exports of torchvision's and Detectron2's Mask R-CNN -> role."""


class Sidecar(Model):
    """How to use an ONNX network."""

    layout: Layout
    outputs: dict[str, str]
    """Role -> name of the output."""
    labels: str | tuple[str, ...] = ""
    """A label set (`coco-80`, `coco-panoptic`, `ade20k`, `scenewright`), or the names in the network's order; empty:
    by the network's own metadata or the number of its classes."""
    numbering: Literal["position", "id"] = "position"
    """`id`: the network gives out the ids of the label set, not positions."""
    size: tuple[int, int] | None = None
    """Width and height of the input [pixels]; None: that of the network, or of the image."""
    resize: Literal["letterbox", "stretch"] = "stretch"
    """How an image comes to that size: padded on the right and below, or by one scale in each direction."""
    order: Literal["rgb", "bgr"] = "rgb"
    scale: float = 1 / 255
    """Values 0..255 are multiplied by this, then `mean` is subtracted and the rest divided by `deviation`."""
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    deviation: tuple[float, float, float] = (1.0, 1.0, 1.0)
    batch: bool = True
    """Whether the input has a batch axis of 1."""


IMAGENET_MEAN, IMAGENET_DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Mean and standard deviation of ImageNet's pictures (R, G, B of 0..1), by which most networks were trained."""


def read_sidecar(path: Path) -> Sidecar:
    """Read a TOML sidecar. Raises BadInput when it is none, or does not name the outputs of its layout."""
    hint = "see docs/SEGMENTATION.md"
    try:
        values = file_toml(path, LARGEST_FILE, hint=hint)
        sidecar = Sidecar.model_validate({k: tuple(v) if isinstance(v, list) else v for k, v in values.items()})
    except ValidationError as error:
        raise BadInput(f"{path}: {first_problem(error)}", hint=hint) from None
    except (ValueError, TypeError, RecursionError) as error:
        raise BadInput(f"{path}: {str(error).splitlines()[0]:.120}", hint=hint) from None
    roles = OUTPUTS[sidecar.layout]
    if set(sidecar.outputs) != set(roles):
        raise BadInput(f"{path}: outputs are {sorted(sidecar.outputs)}, not {sorted(roles)}", hint=hint)
    if sidecar.size is not None and not all(0 < side <= 16384 for side in sidecar.size):
        raise BadInput(f"{path}: size {sidecar.size} is no image's", hint=hint)
    if not sidecar.scale > 0 or min(map(abs, sidecar.deviation)) == 0:
        raise BadInput(f"{path}: a scale or deviation of 0", hint=hint)
    return sidecar


def find_layout(shapes: Mapping[str, tuple[int, ...]]) -> Sidecar | None:
    """Return how to use a network by the names and shapes of what it gave for one image; None when it is not known.

    Known: YOLO segmentation (boxes, class scores and mask coefficients beside prototypes), Mask R-CNN of torchvision
    and Detectron2 by their names, and queries with class logits and mask logits (Mask2Former and its kind).
    """
    roles = {KNOWN_NAMES[name]: name for name in shapes if name in KNOWN_NAMES}
    if set(roles) == set(OUTPUTS["instances"]):
        detectron = "pred_classes" in shapes
        return Sidecar(
            layout="instances",
            outputs=roles,
            labels="coco-80",
            numbering="position" if detectron else "id",
            order="bgr" if detectron else "rgb",
            scale=1.0 if detectron else 1 / 255,
        )
    flat = [name for name, shape in shapes.items() if len(shape) == 3]
    deep = [name for name, shape in shapes.items() if len(shape) == 4]
    if len(shapes) != 2 or len(flat) != 1 or len(deep) != 1:
        return None
    first, second = shapes[flat[0]], shapes[deep[0]]
    if first[1] == second[1]:
        return Sidecar(
            layout="panoptic",
            outputs={"classes": flat[0], "masks": deep[0]},
            mean=IMAGENET_MEAN,
            deviation=IMAGENET_DEVIATION,
        )
    if first[1] > 4 + second[1] and first[2] > first[1]:
        return Sidecar(layout="yolo-seg", outputs={"predictions": flat[0], "prototypes": deep[0]}, resize="letterbox")
    return None
