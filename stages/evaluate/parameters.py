"""Declaration of the step `evaluate`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import Field
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.errors import UsageError
from scenewright.schemas.evaluation import Evaluation
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.plan import Plan
from scenewright.schemas.segments import Segments
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.kit.estimates import grows_with
from scenewright.stages.kit.stage import Optionally, Parameters, Stage


class EvaluateParameters(Parameters):
    """How predictions are matched with the truth."""

    label_distance: float = Field(
        0.05, gt=0, le=1, description="Largest distance of a true point from the map vertex that labels it [m]"
    )
    match_iou: float = Field(0.5, ge=0.5, lt=1, description="IoU above which segments and boxes match")
    node_match_iou: float = Field(
        0.25, gt=0, lt=1, description="Least IoU of a graph node and the true node that it may match"
    )
    mesh_threshold: float = Field(
        0.05, gt=0, description="Largest distance of reconstructed surface from the truth [m]"
    )
    minimum_visible_points: int = Field(
        40, ge=1, description="True entities with fewer visible points (1 cm grid) are optional: neither hit nor miss"
    )
    thesis_minimum_area: float = Field(
        0.1, ge=0, description="Smallest segment of the thesis's variant (1000 points of 1 cm) [m^2]"
    )
    bootstrap_resamples: int = Field(2000, ge=100, le=100000, description="Resamples of the percentile bootstrap")
    plots: bool = Field(True, description="Draw the plots")


def check_inputs(parameters: EvaluateParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError when there is nothing to evaluate."""
    if not set(inputs) - {"ground_truth"}:
        raise UsageError(
            "evaluate: there is nothing to evaluate", hint="give at least one of --panoptic-map, --contact-graph, ..."
        )


STAGE = Stage(
    name="evaluate",
    summary="Measure a reconstruction against ground truth (PQ, AP, graph edit distance, ...), or count what is in it",
    parameters=EvaluateParameters,
    reads={
        "ground_truth": Optionally(GroundTruth),
        "sequence": Optionally(Sequence),
        "trajectory": Optionally(Trajectory),
        "segments": Optionally(Segments),
        "panoptic_map": Optionally(PanopticMap),
        "contact_graph": Optionally(ContactGraph),
        "cad_scene": Optionally(CadScene),
        "interactive_scene": Optionally(InteractiveScene),
        "plan": Optionally(Plan),
        "cad_library": Optionally(CadLibrary),
    },
    writes=Evaluation,
    libraries=("numpy", "scipy", "open3d", "trimesh", "matplotlib"),
    check=check_inputs,
    example="scenewright evaluate --ground-truth outputs/demo/ground_truth "
    "--panoptic-map outputs/demo/panoptic_map --out outputs/demo/evaluation",
    estimate=grows_with("panoptic_map", 0.4, 0.0, 390, 3.5),
)
