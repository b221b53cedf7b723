"""How a contact graph is judged against the truth of a generated room."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.stages.evaluate import (
    EvaluateParameters,
    GraphComparison,
    TrueRoom,
    compare_graphs,
    load_truth,
    optional_nodes,
)
from scenewright.stages.kit.measurement.edge_agreement import BESIDE_THE_TREE, DIRECTED, EdgeAgreement, edge_agreement

from benchmarks.steps import opened

OPTIONS = EvaluateParameters.model_validate({})
RELATIONS = (*DIRECTED, *BESIDE_THE_TREE)
Figures = dict[str, float | None]


def read_room(path: Path, world_from_log: np.ndarray | None = None) -> TrueRoom:
    """Return what is true of a room, in the log's world or another one."""
    truth = opened(GroundTruth, path)
    pose = np.eye(4) if world_from_log is None else world_from_log
    return load_truth(truth, pose, OPTIONS.minimum_visible_points)


def judge(
    room: TrueRoom, graph: ContactGraphFile, overlaps: Mapping[tuple[int, int], float]
) -> tuple[GraphComparison, dict[str, EdgeAgreement]]:
    """Return the edit distance with its parts, and the counts of the edges by relation. `overlaps`: IoU of the visible
    points by (true, predicted) instance."""
    comparison = compare_graphs(room, graph, overlaps, OPTIONS.node_match_iou)
    ignored = optional_nodes(room, comparison.true)
    pairs = dict(comparison.distance.pairs)
    return comparison, edge_agreement(comparison.true, comparison.predicted, pairs, ignored=ignored)


def distance_figures(comparison: GraphComparison) -> Figures:
    """Return the edit distance and its parts, as metrics.json names them."""
    distance = comparison.distance
    return {
        "edit_distance": distance.total,
        "edit_distance_exact": float(distance.exact),
        "wrong_support": len(distance.wrong_supports),
        "missing_detection": len(distance.missing),
        "wrong_detection": distance.wrong_detections,
    }
