"""Step `evaluate`: measure a reconstruction against the ground truth of a generated room, or count what is in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.evaluate.alignment_errors import alignment_error
    from scenewright.stages.evaluate.correspondence import point_overlaps
    from scenewright.stages.evaluate.graph_measures import (
        GraphComparison,
        box_candidates,
        compare_graphs,
        optional_nodes,
    )
    from scenewright.stages.evaluate.joint_errors import placed_joints
    from scenewright.stages.evaluate.map_measures import (
        PredictedMap,
        instance_candidates,
        label_true_points,
        load_map,
        measure_quality,
        quality_thesis_code,
    )
    from scenewright.stages.evaluate.model_shapes import ModelShape, PartShape, PlacedShape, sample_triangles
    from scenewright.stages.evaluate.parameters import EvaluateParameters
    from scenewright.stages.evaluate.point_labels import nearest_labels
    from scenewright.stages.evaluate.replacement_measures import ObjectResult, replacements_of, retrieval_rank
    from scenewright.stages.evaluate.results import Part
    from scenewright.stages.evaluate.shape_loading import model_shape, placed_candidate, true_shapes
    from scenewright.stages.evaluate.truth import TrueRoom, load_truth, stuff_classes

_MODULES = {
    "alignment_error": "scenewright.stages.evaluate.alignment_errors",
    "point_overlaps": "scenewright.stages.evaluate.correspondence",
    "GraphComparison": "scenewright.stages.evaluate.graph_measures",
    "box_candidates": "scenewright.stages.evaluate.graph_measures",
    "compare_graphs": "scenewright.stages.evaluate.graph_measures",
    "optional_nodes": "scenewright.stages.evaluate.graph_measures",
    "placed_joints": "scenewright.stages.evaluate.joint_errors",
    "PredictedMap": "scenewright.stages.evaluate.map_measures",
    "instance_candidates": "scenewright.stages.evaluate.map_measures",
    "label_true_points": "scenewright.stages.evaluate.map_measures",
    "load_map": "scenewright.stages.evaluate.map_measures",
    "measure_quality": "scenewright.stages.evaluate.map_measures",
    "quality_thesis_code": "scenewright.stages.evaluate.map_measures",
    "ModelShape": "scenewright.stages.evaluate.model_shapes",
    "PartShape": "scenewright.stages.evaluate.model_shapes",
    "PlacedShape": "scenewright.stages.evaluate.model_shapes",
    "sample_triangles": "scenewright.stages.evaluate.model_shapes",
    "EvaluateParameters": "scenewright.stages.evaluate.parameters",
    "nearest_labels": "scenewright.stages.evaluate.point_labels",
    "ObjectResult": "scenewright.stages.evaluate.replacement_measures",
    "replacements_of": "scenewright.stages.evaluate.replacement_measures",
    "retrieval_rank": "scenewright.stages.evaluate.replacement_measures",
    "Part": "scenewright.stages.evaluate.results",
    "model_shape": "scenewright.stages.evaluate.shape_loading",
    "placed_candidate": "scenewright.stages.evaluate.shape_loading",
    "true_shapes": "scenewright.stages.evaluate.shape_loading",
    "TrueRoom": "scenewright.stages.evaluate.truth",
    "load_truth": "scenewright.stages.evaluate.truth",
    "stuff_classes": "scenewright.stages.evaluate.truth",
}

__getattr__ = exported(__name__, _MODULES)
