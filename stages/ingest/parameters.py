"""Declaration of the step `ingest`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field
from scenewright.schemas.errors import UsageError
from scenewright.schemas.sequence import Sequence
from scenewright.stages.ingest.pose_convention_names import PoseConvention
from scenewright.stages.ingest.registry import all_layouts
from scenewright.stages.kit.estimates import LOG_MEGABYTES_PER_MEGAPIXEL, Estimate, Inputs
from scenewright.stages.kit.stage import External, Extra, Optionally, Parameters, Stage

if TYPE_CHECKING:
    LogFormatName = str
else:
    LogFormatName = Literal["auto", *(layout.name for layout in all_layouts())]
DepthBits = Literal["as-is", "swapped", "rotated"]


class IngestParameters(Parameters):
    """Options of `ingest`."""

    format: LogFormatName = Field(
        "auto", description="Layout of the log; auto tries each and records the rule that matched"
    )
    fx: float | None = Field(None, gt=0, description="Focal length along x [pixel], overrides the log")
    fy: float | None = Field(None, gt=0, description="Focal length along y [pixel], overrides the log")
    cx: float | None = Field(None, description="Principal point x [pixel], overrides the log")
    cy: float | None = Field(None, description="Principal point y [pixel], overrides the log")
    depth_scale: float | None = Field(
        None, gt=0, description="Depth units per metre, overrides the format's (1000 is millimetres, TUM has 5000)"
    )
    depth_bits: DepthBits = Field(
        "as-is",
        description="How 16-bit depth is stored: as it is, two bytes exchanged, or bits rotated by three (SUN3D)",
    )
    frame_rate: float = Field(30.0, gt=0, description="Frame rate of folders whose images have no time stamps [1/s]")
    every: Annotated[int, Field(ge=1)] | Literal["auto"] = Field(
        1, description="Use every n-th frame of the log; auto: key frames of a posed log, those that add something"
    )
    start: int = Field(0, ge=0, description="First frame of the log to use")
    stop: int | None = Field(None, ge=0, description="Frame of the log to stop before")
    max_frames: int | None = Field(None, ge=1, description="Stop after this many usable frames")
    maximum_time_difference: float = Field(
        0.02, ge=0, description="Largest difference between the stamps of colour and depth of one frame [s]"
    )
    maximum_transform_gap: float = Field(
        0.5, gt=0, description="Largest gap between transforms that a pose is interpolated over [s]"
    )
    maximum_depth: float | None = Field(None, gt=0, description="Maximum depth; depth beyond it becomes invalid [m]")
    register_color: bool = Field(
        True, description="Register the colour of 7-Scenes Kinect logs (640x480, focal length 585) to the depth camera"
    )
    turn: bool = Field(
        True, description="Turn phone recordings in portrait upright, where the log has the gravity direction"
    )
    gravity: Literal["auto", "given", "floor", "imu", "camera-up", "none"] = Field(
        "auto",
        description="Gravity direction: auto takes the log's, else the floor's normal, the IMU's, or the mean "
        "camera up; given takes --up",
    )
    up: Literal["x", "-x", "y", "-y", "z", "-z"] = Field("z", description="Up axis of the log's world, with given")
    baseline: float | None = Field(
        None,
        gt=0,
        le=10,
        description="Stereo baseline, right camera along +x [m]; overrides the calibration's sign and unit",
    )
    camera: tuple[str, ...] = Field(
        (), description="Camera of the log to use, by name, for logs with several; 'all' takes every one"
    )
    color_topic: str | None = Field(None, description="Topic of the colour images, for logs with several")
    depth_topic: str | None = Field(None, description="Topic of the depth images, for logs with several")
    right_topic: str | None = Field(None, description="Topic of the right images of a stereo pair")
    pose_topic: str | None = Field(
        None, description="Topic of odometry or poses to use for the camera instead of the tree of transforms"
    )
    pose_convention: PoseConvention = Field(
        "as-is", description="What the poses of the log are, where they are not world_from_camera with OpenCV axes"
    )
    pose_scale: float = Field(
        1.0, gt=0, description="Factor that turns positions of the log into metres (0.001 where they are millimetres)"
    )
    world_frame: str | None = Field(None, description="Frame that poses are wanted in; default: root of the tree")
    register_depth: bool = Field(
        True, description="Register depth to the colour camera where the log has the extrinsics of the two"
    )
    damage: Literal["salvage", "refuse"] = Field(
        "salvage",
        description="Logs that are torn or damaged: salvage uses what is whole and says what was lost; refuse stops",
    )


def check(parameters: IngestParameters, inputs: Any) -> None:
    """Refuse combinations that cannot work. Raises UsageError."""
    if parameters.stop is not None and parameters.stop <= parameters.start:
        raise UsageError(f"stop {parameters.stop} is not after start {parameters.start}", hint="stop later")


AUTO = "auto"
"""Word of `every` for key frames."""
REPACKED = 1.2
"""Size of a sequence beside its log: 1.0 for MCAP that is packed already, 1.4 for a folder of JPEG and depth PNG."""


def _estimate(parameters: IngestParameters, inputs: Inputs) -> Estimate:
    log = inputs["log"]
    share = 1 / parameters.every if isinstance(parameters.every, int) else 1.0
    if log.megapixels is not None and log.frames is not None:
        frames = min(log.frames * share, parameters.max_frames or log.frames)
        megapixels = frames * log.frame_megapixels
        expected = LOG_MEGABYTES_PER_MEGAPIXEL * megapixels
        least = 0.0 if parameters.every == AUTO else 0.3 * expected
        return Estimate(expected, least, 120, frames, megapixels)
    expected = REPACKED * log.megabytes * share
    cut = (
        parameters.every == AUTO
        or parameters.max_frames is not None
        or parameters.stop is not None
        or parameters.start > 0
    )
    # Raw images shrink to a sixth. A part of the log may be any part of it.
    least = 0.0 if cut else 0.1 * expected
    return Estimate(expected, least, 150, None, expected / LOG_MEGABYTES_PER_MEGAPIXEL)


STAGE = Stage(
    name="ingest",
    summary="Turn a camera log into a sequence: calibrated, posed, gravity-aligned frames",
    parameters=IngestParameters,
    reads={
        "log": External("log: a file (MCAP, bag) or a folder"),
        "trajectory": Optionally(External("Own poses instead of the log's: lines `t tx ty tz qx qy qz qw` (TUM)")),
    },
    writes=Sequence,
    libraries=(
        "numpy",
        "scipy",
        "opencv-python-headless",
        "mcap",
        "protobuf",
        "foxglove-schemas-protobuf",
        "zstandard",
        "rosbags",
        "numba",
        "lz4",
        "ruamel.yaml",
    ),
    extras=(
        Extra("OpenEXR", "OpenEXR", "depth in .exr files: pip install OpenEXR"),
        Extra("lzfse", "lzfse", "Record3D's .r3d files: pip install lzfse"),
    ),
    example="scenewright ingest --log recording.mcap --out outputs/kitchen/sequence",
    check=check,
    estimate=_estimate,
)
