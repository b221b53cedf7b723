"""What an arm made of one scene, by class: counts and rankings, pooled over scenes before they are divided."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.stages.evaluate import (
    EvaluateParameters,
    Part,
    PredictedMap,
    TrueRoom,
    box_candidates,
    instance_candidates,
    label_true_points,
    measure_quality,
    quality_thesis_code,
)
from scenewright.stages.kit.measurement.average_precision import Candidates, match_greedily
from scenewright.stages.kit.measurement.panoptic_quality import ClassQuality


@dataclass(frozen=True)
class Ranked:
    """Predictions of one class in one room with whether each found something true. Matching never crosses rooms, so
    that it is done once and pooling is a sort."""

    confidence: tuple[float, ...]
    hits: tuple[bool, ...]
    true_count: int


@dataclass(frozen=True)
class Outcome:
    """What one arm made of one room in one case, by class."""

    qualities: dict[str, ClassQuality]
    qualities_thesis_code: dict[str, ClassQuality]
    instances: dict[str, Ranked]
    boxes: dict[str, Ranked]
    boxes_refined: dict[str, Ranked]


def outcome_of_map(
    truth: TrueRoom, predicted: PredictedMap, graph: ContactGraphFile, options: EvaluateParameters
) -> Outcome:
    """Measure a map and the boxes of its contact graph against the truth, by class."""
    labels = label_true_points(truth, predicted, options.label_distance)
    points: Mapping[int, int] = {entity.instance: entity.vertices for entity in predicted.info.entities}
    return Outcome(
        qualities=measure_quality(Part("map"), truth, predicted, labels, options),
        qualities_thesis_code=quality_thesis_code(truth, predicted, options),
        instances=ranked(instance_candidates(truth, predicted, labels)),
        boxes=ranked(box_candidates(truth, graph, points, "box_observed", options.match_iou)),
        boxes_refined=ranked(box_candidates(truth, graph, points, "box", options.match_iou)),
    )


def ranked(candidates: Mapping[str, Candidates]) -> dict[str, Ranked]:
    """Match the predictions of each class in falling confidence (`average_precision.match_greedily`)."""
    result = {}
    for name, found in candidates.items():
        matches = match_greedily(found.iou, found.confidence)
        confidence = tuple(float(found.confidence[row]) for row, _ in matches)
        result[name] = Ranked(confidence, tuple(truth is not None for _, truth in matches), found.iou.shape[1])
    return result
