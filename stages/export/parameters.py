"""Declarations of `export`, `export scene` and `export plan`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field
from scenewright.schemas.errors import UsageError
from scenewright.schemas.exported_scene import ExportedScene
from scenewright.schemas.exported_sequence import ExportedSequence
from scenewright.schemas.exported_trajectory import ExportedTrajectory
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.plan import Plan
from scenewright.schemas.segments import Segments
from scenewright.schemas.sequence import Sequence
from scenewright.stages.export.registry import STREAMS, all_formats, dialects, layouts
from scenewright.stages.export.scene_registry import scene_formats
from scenewright.stages.kit.estimates import Estimate, Inputs, grows_with
from scenewright.stages.kit.simulation.robot_option import robot_files, robot_option
from scenewright.stages.kit.stage import Optionally, Parameters, Stage

if TYPE_CHECKING:
    Layout = str
    Dialect = str
    Target = str
else:
    Layout = Literal[layouts()]
    Dialect = Literal[dialects()]
    Target = Literal[tuple(declared.name for declared in scene_formats())]


class ExportParameters(Parameters):
    """Options of `export`."""

    layout: Layout = Field(layouts()[0], description="What to write the sequence as")
    dialect: Dialect = Field(
        dialects()[0],
        description="Message types, where a layout has several: "
        + "; ".join(
            f"`{declared.dialect}` for {declared.layout}: {declared.summary}"
            for declared in all_formats()
            if declared.dialect
        ),
    )
    every: int = Field(1, ge=1, description="Write every n-th frame")
    streams: tuple[str, ...] = Field(
        (), description=f"Stream to write, of {', '.join(STREAMS)}; default: all that the layout holds"
    )
    camera: str | None = Field(
        None, description="Camera to write; default: the main one for TUM, which holds one, else all of them"
    )


def check(parameters: ExportParameters, inputs: Any) -> None:
    """Refuse unknown streams, and options that the layout would ignore. Raises UsageError."""
    unknown = sorted(set(parameters.streams) - set(STREAMS))
    if unknown:
        raise UsageError(f"export: --streams: no stream {unknown[0]!r}", hint=f"streams are {', '.join(STREAMS)}")
    own_dialects = dialects([parameters.layout])
    if parameters.dialect not in (own_dialects or dialects()[:1]):
        meant = next(declared.layout for declared in all_formats() if declared.dialect == parameters.dialect)
        raise UsageError(
            f"export: --dialect {parameters.dialect} is about {meant.upper()}, not about {parameters.layout}",
            hint=f"add --layout {meant}",
        )


def _estimate(parameters: ExportParameters, inputs: Inputs) -> Estimate:
    sequence = inputs["sequence"]
    expected = (
        sequence.megabytes
        / parameters.every
        * {"tum": 1.16, "nerfstudio": 1.08, "mcap": 1.0, "coco": 0.5}[parameters.layout]
    )
    cut = bool(parameters.streams) or parameters.camera is not None
    return Estimate(expected, 0.0 if cut else 0.5 * expected, 120)


class SceneExportParameters(Parameters):
    """Options of `export scene`."""

    to: Target = Field(
        scene_formats()[0].name,
        description="; ".join(f"`{declared.name}`: {declared.summary}" for declared in scene_formats()),
    )


class PlanExportParameters(Parameters):
    """Options of `export plan`."""

    robot: str = robot_option("the one that the plan is for")


EXPORT = Stage(
    name="export",
    summary="Write a sequence back as TUM RGB-D, nerfstudio or MCAP, or with its masks as COCO, for other tools",
    parameters=ExportParameters,
    reads={"sequence": Sequence, "segments": Optionally(Segments)},
    writes=ExportedSequence,
    libraries=("numpy", "scipy", "opencv-python-headless", "mcap", "protobuf", "zstandard", "rosbags"),
    example="scenewright export --sequence outputs/demo/sequence --layout tum --out outputs/demo/tum",
    check=check,
    estimate=_estimate,
)

EXPORT_SCENE = Stage(
    name="export scene",
    summary="Write a scene as USD, SDF, MoveIt planning scene or Hydra graph; MJCF and GLB stand in it already",
    parameters=SceneExportParameters,
    reads={"scene": InteractiveScene},
    writes=ExportedScene,
    module="scene_stage",
    libraries=("numpy", "scipy", "trimesh"),
    versions="scene_registry",
    extras=tuple(declared.extra for declared in scene_formats() if declared.extra),
    example="scenewright export scene --to usd --scene outputs/demo/interactive_scene --out outputs/demo/usd",
    estimate=grows_with("scene", 0.0, 1.5, 130, 1.0),
)

EXPORT_PLAN = Stage(
    name="export plan",
    summary="Write a plan's motions as ROS 2 joint trajectories (YAML, MCAP) and CSV; not run on hardware",
    parameters=PlanExportParameters,
    reads={"plan": Plan},
    writes=ExportedTrajectory,
    module="plan_stage",
    libraries=("numpy", "mcap", "zstandard", "rosbags"),
    data_files=lambda parameters: robot_files(parameters.robot),
    example="scenewright export plan --plan outputs/demo/plan --out outputs/demo/trajectory",
)

STAGES = (EXPORT, EXPORT_SCENE, EXPORT_PLAN)
