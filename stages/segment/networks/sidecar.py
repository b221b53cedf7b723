"""What goes into a network and what comes out: said by a TOML beside it, or found out from its outputs."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput, first_problem
from scenewright.schemas.outside import file_toml

Layout = Literal[
    "yolo-seg", "yolo-objectness", "yolo-end-to-end", "instances", "query-instances", "panoptic", "semantic"
]
HINT = "say what goes in and what comes out with --sidecar FILE.toml (docs/FORMATS.md, Networks in ONNX and TFLite)"
BY_FOLDER = "run it in a script of your own and give its masks with --backend masks (docs/MASKS.md)"
LARGEST_FILE = 2**20
"""Most bytes of a sidecar."""
END_TO_END = 6
"""Columns of an end-to-end prediction before its coefficients: corners of the box, score, class."""
OBJECTNESS = 5
"""Columns of a prediction with objectness before its classes: the box, and how sure it is that there is a thing."""
MOST_END_TO_END = 1000
"""Most rows that an end-to-end export is taken to give (its usual `max_det` is 300). With one class and objectness
rows are as long, and there are thousands of them."""
OUTPUTS: Mapping[str, tuple[str, ...]] = {
    "yolo-seg": ("predictions", "prototypes"),
    "yolo-objectness": ("predictions", "prototypes"),
    "yolo-end-to-end": ("predictions", "prototypes"),
    "instances": ("boxes", "labels", "scores", "masks"),
    "query-instances": ("classes", "masks"),
    "panoptic": ("classes", "masks"),
    "semantic": ("classes",),
}
"""Layout -> roles of its outputs. `instances` needs no `scores` where boxes have them as a fifth column."""
SHAPES: Mapping[str, str] = {
    "yolo-seg": "predictions (1, 4+C+M, N), prototypes (1, M, h, w)",
    "yolo-objectness": "predictions (1, N, 5+C+M), prototypes (1, M, h, w)",
    "yolo-end-to-end": "predictions (1, N, 6+M), prototypes (1, M, h, w)",
    "instances": "boxes (N, 4 or 5), labels (N,), scores (N,), masks (N, [1,] h, w)",
    "query-instances": "classes (1, Q, C), masks (1, Q, h, w)",
    "panoptic": "classes (1, Q, C+1), masks (1, Q, h, w)",
    "semantic": "classes (1, C, h, w) or (1, h, w, C) scores, or (1, h, w) numbers",
}
"""Layout -> what its outputs look like, for messages."""
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
    """How to use a network."""

    layout: Layout
    outputs: dict[str, str]
    """Role -> name of the output."""
    labels: str | tuple[str, ...] = ""
    """A label set (`coco-80`, `coco-panoptic`, `ade20k`, `ade20k-31`, `pascal-voc`, `scenewright`), or the names in the
    network's order; empty: by the network's own metadata or the number of its classes."""
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


IMAGENET: Mapping[str, Any] = {"mean": IMAGENET_MEAN, "deviation": IMAGENET_DEVIATION}
INPUTS: Mapping[str, Mapping[str, Any]] = {
    "yolo-seg": {"resize": "letterbox"},
    "yolo-objectness": {"resize": "letterbox"},
    "yolo-end-to-end": {"resize": "letterbox"},
    "query-instances": IMAGENET,
    "panoptic": IMAGENET,
}
"""Layout -> what goes in, where a sidecar does not say it."""


def read_sidecar(path: Path) -> Sidecar:
    """Read a TOML sidecar. Raises BadInput when it is none, or does not name the outputs of its layout."""
    hint = "see docs/FORMATS.md, Networks in ONNX and TFLite"
    try:
        values = file_toml(path, LARGEST_FILE, hint=hint)
        told = {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}
        sidecar = Sidecar.model_validate({**INPUTS.get(str(told.get("layout")), {}), **told})
    except ValidationError as error:
        raise BadInput(f"{path}: {first_problem(error)}", hint=hint) from None
    except (ValueError, TypeError, RecursionError) as error:
        raise BadInput(f"{path}: {str(error).splitlines()[0]:.120}", hint=hint) from None
    roles = OUTPUTS[sidecar.layout]
    if set(sidecar.outputs) not in (set(roles), set(roles) - {"scores"}):
        raise BadInput(f"{path}: outputs are {sorted(sidecar.outputs)}, not {sorted(roles)}", hint=hint)
    if sidecar.size is not None and not all(0 < side <= 16384 for side in sidecar.size):
        raise BadInput(f"{path}: size {sidecar.size} is not an image's", hint=hint)
    if not sidecar.scale > 0 or min(map(abs, sidecar.deviation)) == 0:
        raise BadInput(f"{path}: a scale or deviation of 0", hint=hint)
    return sidecar


def find_layout(
    shapes: Mapping[str, tuple[int, ...]], classes: int = 0, whole_numbers: Collection[str] = ()
) -> Sidecar | None:
    """Return how to use a network by the names and shapes of what it gave for one image; None when it is not known.

    `classes` is how many the file's metadata names, 0 for none; `whole_numbers` are the outputs that hold such. Known:
    YOLO segmentation, raw (boxes, class scores and mask coefficients beside prototypes), with objectness (the same row
    by row, as YOLOv5 and YOLOv7 write it) and end to end (boxes with score, class and coefficients), Mask R-CNN of
    torchvision, Detectron2 and MMDeploy and RF-DETR by their names, queries with class logits and mask logits
    (Mask2Former, DETR and their kind), and semantic networks: scores of classes for every pixel, or the number of its
    class (DeepLab, SegFormer; torchvision's `out` and `aux`).
    """
    pixels = "out" if set(shapes) == {"out", "aux"} else next(iter(shapes)) if len(shapes) == 1 else ""
    if pixels and _is_semantic(shapes[pixels], pixels in whole_numbers):
        return Sidecar(layout="semantic", outputs={"classes": pixels})
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
    if set(shapes) == {"dets", "labels", "masks"}:
        if shapes["dets"][-1:] == (5,):  # MMDeploy, with the input of MMDetection's own configurations
            mmdeploy = {"boxes": "dets", "labels": "labels", "masks": "masks"}
            normal = INPUTS["panoptic"]
            return Sidecar(layout="instances", outputs=mmdeploy, labels="coco-80", resize="letterbox", **normal)
        if len(shapes["labels"]) == 3 and len(shapes["masks"]) == 4:
            return _known("query-instances", classes="labels", masks="masks")
    if {"logits", "pred_masks"} <= set(shapes) <= {"logits", "pred_masks", "pred_boxes"}:
        return _known("panoptic", classes="logits", masks="pred_masks")
    flat = [name for name, shape in shapes.items() if len(shape) == 3]
    deep = [name for name, shape in shapes.items() if len(shape) == 4]
    if len(shapes) != 2 or len(flat) != 1 or len(deep) != 1:
        return None
    first, second = shapes[flat[0]], shapes[deep[0]]
    if first[1] == second[1]:
        return _known("panoptic", classes=flat[0], masks=deep[0])
    if first[2] == second[1] + END_TO_END and (first[1] <= MOST_END_TO_END or classes > 1):
        return _known("yolo-end-to-end", predictions=flat[0], prototypes=deep[0])
    scores = first[2] - second[1] - OBJECTNESS
    if scores > 0 and (scores == classes or (not classes and first[1] > first[2])):
        return _known("yolo-objectness", predictions=flat[0], prototypes=deep[0])
    if first[1] > 4 + second[1] and first[2] > first[1]:
        return _known("yolo-seg", predictions=flat[0], prototypes=deep[0])
    return None


def _is_semantic(shape: tuple[int, ...], whole_numbers: bool) -> bool:
    """Whether an output of one image says something of every pixel; scores have at least two classes."""
    if whole_numbers:
        return (len(shape) == 3 or (len(shape) == 4 and 1 in (shape[1], shape[3]))) and sorted(shape)[-2] > 1
    return len(shape) == 4 and min(shape[1:]) > 1


def channels_axis(shape: tuple[int, ...], size: tuple[int, int], otherwise: int) -> int:
    """Return which axis, 1 or 3, of an output (1, C, h, w) or (1, h, w, C) of a picture has the channels.

    `size` (width, height) of the input: h and w are by the same factor smaller. `otherwise`: what holds where that
    does not tell.
    """
    wide, high = size
    fits = {axis: shape[s] * wide == shape[s + 1] * high for axis, s in ((1, 2), (3, 1))}
    return otherwise if fits[1] == fits[3] else 1 if fits[1] else 3


def with_values(sidecar: Sidecar, **values: Any) -> Sidecar:
    """Return the sidecar with scale, mean or deviation of `values` where nobody said any of them."""
    told = {"scale", "mean", "deviation"} & sidecar.model_fields_set
    return sidecar if told else sidecar.model_copy(update=values)


def _known(layout: Layout, **outputs: str) -> Sidecar:
    return Sidecar(layout=layout, outputs=outputs, **INPUTS[layout])


def misfit(layout: str, shapes: Mapping[str, tuple[int, ...]]) -> str:
    """Return what is wrong with the shapes of a layout's outputs, by role; empty: nothing that can be seen."""
    if layout == "yolo-objectness":
        first, second = shapes["predictions"], shapes["prototypes"]
        if len(first) == 3 and len(second) == 4 and first[2] > second[1] + OBJECTNESS:
            return ""
    elif layout in ("yolo-seg", "yolo-end-to-end"):
        first, second = shapes["predictions"], shapes["prototypes"]
        if len(first) == 3 and len(second) == 4:
            end_to_end = first[2] == second[1] + END_TO_END
            if end_to_end != (layout == "yolo-end-to-end"):
                other = "yolo-end-to-end" if end_to_end else "yolo-seg"
                return f"these are the shapes of {other}"
            if end_to_end or first[1] > 4 + second[1]:
                return ""
    elif layout == "semantic":
        if len(shapes["classes"]) in (3, 4) and shapes["classes"][0] == 1:
            return ""
    elif layout == "instances":
        if shapes["boxes"][-1:] == ((4,) if "scores" in shapes else (5,)):
            return ""
    elif len(shapes["classes"]) == 3 and len(shapes["masks"]) == 4 and shapes["classes"][1] == shapes["masks"][1]:
        return ""
    return f"{layout} has {SHAPES[layout]}"


def only_boxes(shapes: Mapping[str, tuple[int, ...]]) -> bool:
    """Return whether the outputs of one image are those of a detector: boxes, no masks."""
    if len(shapes) == 1:
        (shape,) = shapes.values()
        return len(shape) in (2, 3) and min(shape[-2:]) >= 5
    return all(len(shape) <= 3 for shape in shapes.values()) and any(
        shape[-1:] in ((4,), (5,)) for shape in shapes.values()
    )


def unknown(path: Path, shapes: Mapping[str, tuple[int, ...]]) -> BadInput:
    """Return the error for a network whose outputs are of no known layout."""
    shapes_text = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
    if only_boxes(shapes):
        return BadInput(
            f"{path.name}: gives boxes without masks ({shapes_text:.200})",
            hint=f"export a segmentation network instead (yolo export model=yolo11n-seg.pt format={path.suffix[1:]}); "
            "of networks that give boxes, --backend detector takes YOLOX",
        )
    layouts = "; ".join(f"{name}: {text}" for name, text in SHAPES.items())
    return BadInput(
        f"{path.name}: its outputs ({shapes_text:.200}) are of no known layout",
        hint=f"if it is one of these, {HINT}: {layouts}. Else {BY_FOLDER}",
    )


def roles_of(path: Path, sidecar: Sidecar, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, tuple[int, ...]]:
    """Return role -> shape of the outputs that a sidecar names. Raises BadInput when one is not there or does not
    fit."""
    missing = [name for name in sidecar.outputs.values() if name not in shapes]
    if missing:
        raise BadInput(f"{path.name}: has no output {missing[0]!r:.60}", hint=f"it has: {', '.join(shapes)}")
    by_role = {role: shapes[name] for role, name in sidecar.outputs.items()}
    wrong = misfit(sidecar.layout, by_role)
    if wrong:
        shapes_text = ", ".join(f"{role} {shape}" for role, shape in by_role.items())
        raise BadInput(
            f"{path.name}: gives {shapes_text:.200}; {wrong}", hint="correct `layout` or `outputs` in the sidecar"
        )
    return by_role
