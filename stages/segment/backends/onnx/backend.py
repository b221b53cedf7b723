"""Backend `onnx`: the masks of an ONNX network with classes of the vocabulary."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.schemas.vocabulary import Vocabulary, load_vocabulary
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.kit.labels import LabelMap, LabelSet, load_label_set, match_labels, read_label_file
from scenewright.stages.segment.backends.onnx import decoding
from scenewright.stages.segment.backends.onnx.network import HINT, Network
from scenewright.stages.segment.backends.onnx.sidecar import OBJECTNESS, read_sidecar
from scenewright.stages.segment.choice import BackendRequest
from scenewright.stages.segment.geometric import GeometricFrame, pixels_at
from scenewright.stages.segment.naming import InstanceMask, NamedSegment, name_instances, name_segments
from scenewright.stages.segment.panoptic import PanopticFrame

COCO_IDS = 91
"""Classes of a network that gives out COCO's own ids, which have gaps."""
SETS_BY_SIZE = {80: "coco-80", COCO_IDS: "coco-80", 133: "coco-panoptic", 150: "ade20k"}
"""Number of classes -> label set of published networks, in its order."""
RAW_YOLO = {"yolo-seg": decoding.yolo_seg, "yolo-objectness": decoding.yolo_objectness}
"""Layout -> what reads it: boxes that are not suppressed yet."""

logger = logging.getLogger("scenewright")


class OnnxBackend:
    """An instance or panoptic network. `minimum_pixels` holds at 640x480.

    Raises MissingDependency without weights or ONNX Runtime, BadInput when the network's layout or labels are unknown.
    """

    name = "onnx"
    streams: tuple[str, ...] = ("color", "depth")

    def __init__(
        self,
        weights: Path | None,
        sidecar: Path | None,
        labels: LabelSet | None,
        vocabulary: Vocabulary,
        *,
        score_threshold: float,
        suppression_overlap: float,
        minimum_pixels: int,
        device: str,
    ) -> None:
        if weights is None:
            raise MissingDependency(
                "--backend onnx needs a network", hint="give an .onnx file with --weights (docs/SEGMENTATION.md)"
            )
        self._network = Network(weights, read_sidecar(sidecar) if sidecar else None, device)
        self._labels = _label_map(self._network, labels)
        self._vocabulary = vocabulary
        self._threshold, self._overlap, self._minimum = score_threshold, suppression_overlap, minimum_pixels
        self.label = f"onnx {Path(weights).stem} ({self._network.sidecar.layout}, {self._labels.set_name})"

    def __call__(self, frame: Frame, geometric: GeometricFrame, random: np.random.Generator) -> PanopticFrame:
        """Return the masks of a frame; a frame without colour has none. Raises BadInput when the network fails."""
        if frame.color is None:
            return PanopticFrame(np.zeros(geometric.labels.shape, dtype=np.int32))
        shape = (frame.color.shape[0], frame.color.shape[1])
        least = pixels_at(self._minimum, shape)
        fitted = self._network.fit(frame.color)
        outputs = self._network(fitted)
        if self._network.sidecar.layout == "panoptic":
            ids, segments = decoding.panoptic(
                outputs["classes"],
                outputs["masks"],
                fitted,
                shape,
                score_threshold=self._threshold,
                stuff=self._labels.stuff(),
            )
            named_segments = {
                segment: NamedSegment(self._labels.labels[number], score)
                for segment, (number, score) in segments.items()
                if number in self._labels.labels
            }
            return name_segments(ids, named_segments, self._vocabulary, minimum_pixels=least)
        if self._network.sidecar.layout in RAW_YOLO:
            things = RAW_YOLO[self._network.sidecar.layout](
                outputs["predictions"],
                outputs["prototypes"],
                fitted,
                shape,
                score_threshold=self._threshold,
                suppression_overlap=self._overlap,
            )
        elif self._network.sidecar.layout == "yolo-end-to-end":
            things = decoding.yolo_end_to_end(
                outputs["predictions"], outputs["prototypes"], fitted, shape, score_threshold=self._threshold
            )
        elif self._network.sidecar.layout == "query-instances":
            things = decoding.query_instances(
                outputs["classes"], outputs["masks"], fitted, shape, score_threshold=self._threshold
            )
        else:
            things = decoding.instances(
                outputs["boxes"],
                outputs["labels"],
                outputs.get("scores"),
                outputs["masks"],
                fitted,
                shape,
                score_threshold=self._threshold,
            )
        masks = [
            InstanceMask(thing.mask, self._labels.labels[thing.number], thing.score)
            for thing in things
            if thing.number in self._labels.labels
        ]
        return name_instances(masks, shape, self._vocabulary, minimum_pixels=least)


def _label_map(network: Network, label_set: LabelSet | None) -> LabelMap:
    """Return what the network's numbers stand for: by its metadata, its sidecar, or the number of its classes."""
    sidecar, name = network.sidecar, network.path.name
    if isinstance(sidecar.labels, tuple):
        named, given = len(sidecar.labels), class_count(network)
        if given is not None and named != given:
            logger.warning("%s: has %d classes, `labels` of the sidecar name %d; others stay void", name, given, named)
        return _warn_of_unknown(match_labels(dict(enumerate(sidecar.labels)), label_set, where=name), name)
    if (network.is_guessed or not sidecar.labels) and (names := network.names()):
        return _warn_of_unknown(match_labels(names, label_set, where=name), name)
    count = class_count(network)
    set_name = sidecar.labels or SETS_BY_SIZE.get(count or 0, "")
    if not set_name:
        classes = "classes" if count is None else f"{count} classes"
        outputs = ", ".join(f'{role} = "{output}"' for role, output in sidecar.outputs.items())
        raise BadInput(
            f"{name}: nothing says what its {classes} are",
            hint=f'--sidecar FILE.toml with layout = "{sidecar.layout}", labels = ["chair", ...], '
            f"outputs = {{ {outputs} }}",
        )
    labels = load_label_set(set_name)
    if network.is_guessed or not sidecar.labels:
        known = "its outputs name no classes" if count is None else f"{count} classes"
        logger.info("%s: %s, taken for those of %s (`labels` in --sidecar says others)", name, known, set_name)
    if sidecar.numbering == "id" or count == COCO_IDS:
        names = {label.id: label.name for label in labels.labels if label.id is not None}
    else:
        if count is not None and count != len(labels.labels):
            raise BadInput(f"{name}: has {count} classes, {set_name} has {len(labels.labels)}", hint=HINT)
        names = {number: label.name for number, label in enumerate(labels.labels)}
    return _warn_of_unknown(match_labels(names, label_set or labels, where=name), name)


def class_count(network: Network) -> int | None:
    """Return how many classes the shapes of the outputs tell of; None when they do not."""
    if network.sidecar.layout == "panoptic":
        return network.shapes["classes"][2] - 1
    if network.sidecar.layout == "query-instances":
        return network.shapes["classes"][2]
    if network.sidecar.layout == "yolo-seg":
        return network.shapes["predictions"][1] - 4 - network.shapes["prototypes"][1]
    if network.sidecar.layout == "yolo-objectness":
        return network.shapes["predictions"][2] - OBJECTNESS - network.shapes["prototypes"][1]
    return None


def _warn_of_unknown(matched: LabelMap, name: str) -> LabelMap:
    if matched.unknown:
        logger.warning(
            "%s: %d of its labels are in no table and stay void: %s",
            name,
            len(matched.unknown),
            ", ".join(matched.unknown[:10]),
        )
    return matched


def open_backend(request: BackendRequest) -> OnnxBackend:
    """Return the backend that the request asks for. Raises as the class does, and BadInput for damaged labels."""
    parameters = request.parameters
    return OnnxBackend(
        request.weights,
        request.sidecar,
        read_label_file(request.labels) if request.labels else None,
        load_vocabulary(),
        score_threshold=parameters.score_threshold,
        suppression_overlap=parameters.suppression_overlap,
        minimum_pixels=parameters.small_object_pixels,
        device=request.device,
    )
