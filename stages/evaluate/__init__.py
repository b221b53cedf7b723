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

__getattr__ = exported(__name__)
