"""Declaration of `scenewright export`."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from schemas.errors import UsageError
from schemas.exported_sequence import ExportedSequence
from schemas.sequence import Sequence
from stages.kit.estimates import Estimate, Inputs
from stages.kit.stage import Parameters, Stage

STREAMS = ("color", "depth", "right", "labels", "pose")


class ExportParameters(Parameters):
    """Options of `export`."""

    layout: Literal["tum", "nerfstudio", "mcap"] = Field("tum", description="What to write the sequence as")
    dialect: Literal["foxglove", "ros2"] = Field(
        "foxglove", description="Message types of MCAP: Foxglove protobuf, or ROS 2 (CDR) for ros2 bag and RViz"
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
    if parameters.dialect != "foxglove" and parameters.layout != "mcap":
        raise UsageError(
            f"export: --dialect {parameters.dialect} is about MCAP, not about {parameters.layout}",
            hint="add --layout mcap",
        )


def _estimate(parameters: ExportParameters, inputs: Inputs) -> Estimate:
    sequence = inputs["sequence"]
    expected = sequence.megabytes / parameters.every * {"tum": 1.16, "nerfstudio": 1.08, "mcap": 1.0}[parameters.layout]
    cut = bool(parameters.streams) or parameters.camera is not None
    return Estimate(expected, 0.0 if cut else 0.5 * expected, 120)


STAGE = Stage(
    name="export",
    version=1,
    summary="Write a sequence back as TUM RGB-D, nerfstudio or MCAP, for other tools",
    parameters=ExportParameters,
    reads={"sequence": Sequence},
    writes=ExportedSequence,
    libraries=("numpy", "scipy", "opencv-python-headless", "mcap", "protobuf", "zstandard", "rosbags"),
    example="scenewright export --sequence outputs/demo/sequence --layout tum --out outputs/demo/tum",
    check=check,
    estimate=_estimate,
)
