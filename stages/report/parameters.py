"""Declaration of the step `report`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import Field

from schemas.cad_library import CadLibrary
from schemas.cad_scene import CadScene
from schemas.contact_graph import ContactGraph
from schemas.errors import UsageError
from schemas.evaluation import Evaluation, Report
from schemas.ground_truth import GroundTruth
from schemas.interactive_scene import InteractiveScene
from schemas.packing import Packing
from schemas.panoptic_map import PanopticMap
from schemas.plan import Plan
from schemas.segments import Segments
from schemas.sequence import Sequence
from schemas.suture_needle import SutureNeedle, SutureThread
from schemas.suture_trial import SutureEvaluation, SutureTrial
from schemas.tableware_detections import TablewareDetections
from schemas.tableware_plan import TablewarePlan
from schemas.tableware_trial import TablewareEvaluation, TablewareTrial
from schemas.trajectory import Trajectory
from stages.kit.stage import Optionally, Parameters, Stage


class ReportParameters(Parameters):
    """What the page shows."""

    title: str = Field("", description="Title of the page; empty: made from the inputs")
    frames: int = Field(6, ge=0, le=24, description="Input frames shown")
    frame_width: int = Field(400, ge=120, le=1280, description="Width of frame pictures [px]")
    view_width: int = Field(960, ge=240, le=1920, description="Width of rendered views [px]")
    candidates: int = Field(4, ge=0, le=12, description="CAD candidates shown of each object, 0: none")
    candidate_width: int = Field(150, ge=60, le=480, description="Width of the pictures of candidates [px]")
    keyframes: int = Field(16, ge=0, le=40, description="Key frames of the plan shown at most")


def check_inputs(parameters: ReportParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError when there is nothing to report."""
    if not inputs:
        raise UsageError(
            "report: there is nothing to report", hint="give at least one artifact, --sequence for example"
        )


STAGE = Stage(
    name="report",
    version=7,
    summary="Write one self-contained HTML page about a run: pictures, graph, figures, times, how it was made",
    parameters=ReportParameters,
    reads={
        "ground_truth": Optionally(GroundTruth),
        "sequence": Optionally(Sequence),
        "trajectory": Optionally(Trajectory),
        "segments": Optionally(Segments),
        "panoptic_map": Optionally(PanopticMap),
        "contact_graph": Optionally(ContactGraph),
        "cad_scene": Optionally(CadScene),
        "cad_library": Optionally(CadLibrary),
        "interactive_scene": Optionally(InteractiveScene),
        "plan": Optionally(Plan),
        "packing": Optionally(Packing),
        "tableware_detections": Optionally(TablewareDetections),
        "tableware_plan": Optionally(TablewarePlan),
        "tableware_trial": Optionally(TablewareTrial),
        "tableware_evaluation": Optionally(TablewareEvaluation),
        "suture_needle": Optionally(SutureNeedle),
        "suture_thread": Optionally(SutureThread),
        "suture_trial": Optionally(SutureTrial),
        "suture_evaluation": Optionally(SutureEvaluation),
        "evaluation": Optionally(Evaluation),
        "baseline_evaluation": Optionally(Evaluation),
    },
    writes=Report,
    libraries=("numpy", "scipy", "jinja2", "matplotlib", "pillow", "open3d"),
    check=check_inputs,
    example="scenewright report --sequence outputs/demo/sequence --panoptic-map outputs/demo/panoptic_map "
    "--evaluation outputs/demo/evaluation --out outputs/demo/report",
)
