"""What the numbers of a network stand for: by its metadata, its sidecar, or how many there are."""

from __future__ import annotations

import logging

from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.labels import LabelMap, LabelSet, load_label_set, match_labels
from scenewright.stages.segment.networks.fitting import DEFAULT_SIZE
from scenewright.stages.segment.networks.opening import Network
from scenewright.stages.segment.networks.sidecar import HINT, OBJECTNESS, channels_axis

COCO_IDS = 91
"""Classes of a network that gives out COCO's own ids, which have gaps."""
SETS_BY_SIZE = {80: "coco-80", COCO_IDS: "coco-80", 133: "coco-panoptic", 150: "ade20k"}
"""Number of classes -> label set of published networks, in its order."""
SEMANTIC_SETS = {21: "pascal-voc", 32: "ade20k-31", 150: "ade20k", 151: "ade20k"}
"""The same for semantic networks. With one class more than the set, 0 is what it has no label for."""

logger = logging.getLogger("scenewright")


def label_map(network: Network, label_set: LabelSet | None) -> LabelMap:
    """Return what the network's numbers stand for. Raises BadInput when nothing says it."""
    sidecar, name = network.sidecar, network.path.name
    count = class_count(network)
    if isinstance(sidecar.labels, tuple):
        named = len(sidecar.labels)
        if count is not None and named != count:
            logger.warning("%s: has %d classes, `labels` of the sidecar name %d; others stay void", name, count, named)
        return _warn_of_unknown(match_labels(dict(enumerate(sidecar.labels)), label_set, where=name), name)
    if (network.is_guessed or not sidecar.labels) and (names := network.names()):
        return _warn_of_unknown(match_labels(names, label_set, where=name), name)
    semantic = sidecar.layout == "semantic"
    set_name = sidecar.labels or (SEMANTIC_SETS if semantic else SETS_BY_SIZE).get(count or 0, "")
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
    if sidecar.numbering == "id" or count == COCO_IDS or (semantic and count == len(labels.labels) + 1):
        names = {label.id: label.name for label in labels.labels if label.id is not None}
    else:
        if count is not None and count != len(labels.labels):
            raise BadInput(f"{name}: has {count} classes, {set_name} has {len(labels.labels)}", hint=HINT)
        names = {number: label.name for number, label in enumerate(labels.labels)}
    return _warn_of_unknown(match_labels(names, label_set, labels, where=name), name)


def class_count(network: Network) -> int | None:
    """Return how many classes the shapes of the outputs tell of; None when they do not."""
    layout, shapes = network.sidecar.layout, network.shapes
    if layout == "panoptic":
        return shapes["classes"][2] - 1
    if layout == "query-instances":
        return shapes["classes"][2]
    if layout == "yolo-seg":
        return shapes["predictions"][1] - 4 - shapes["prototypes"][1]
    if layout == "yolo-objectness":
        return shapes["predictions"][2] - OBJECTNESS - shapes["prototypes"][1]
    if layout == "semantic":
        shape = shapes["classes"]
        several = len(shape) == 4 and min(shape[1], shape[3]) > 1
        return shape[channels_axis(shape, network.size or DEFAULT_SIZE, 1)] if several else network.classes
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
