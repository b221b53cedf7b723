"""Declaration of the step `report`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import Field
from scenewright.schemas.errors import UsageError
from scenewright.schemas.evaluation import Report
from scenewright.stages.kit.estimates import grows_with
from scenewright.stages.kit.stage import Optionally, Parameters, Stage
from scenewright.stages.report.section import all_roles


class ReportParameters(Parameters):
    """What the page shows."""

    title: str = Field("", description="Title of the page; empty: made from the inputs")
    frames: int = Field(6, ge=0, le=24, description="Input frames shown")
    frame_width: int = Field(400, ge=120, le=1280, description="Width of frame images [px]")
    view_width: int = Field(960, ge=240, le=1920, description="Width of rendered views [px]")
    candidates: int = Field(4, ge=0, le=12, description="CAD candidates shown of each thing, 0: none")
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
    summary="Write one self-contained HTML page about a run: pictures, graph, figures, times, how it was made",
    parameters=ReportParameters,
    reads={role: Optionally(kind) for role, kind in all_roles().items()},
    writes=Report,
    libraries=("numpy", "scipy", "jinja2", "matplotlib", "pillow", "open3d", "trimesh"),
    check=check_inputs,
    example="scenewright report --sequence outputs/demo/sequence --panoptic-map outputs/demo/panoptic_map "
    "--evaluation outputs/demo/evaluation --out outputs/demo/report",
    estimate=grows_with("panoptic_map", 1.0, 0.02, 840, 9.5),
)
