"""Declaration of the step `tableware detect`, for the list in stages/tableware/parameters.py."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field
from scenewright.schemas.errors import UsageError
from scenewright.schemas.tableware_detections import TablewareDetections
from scenewright.stages.kit.stage import External, Optionally, Parameters, Stage

DISHES_FILE = External("dishes.toml: what your dishes and your gripper measure [m] (docs/TIDY.md)")


class DetectParameters(Parameters):
    """Options of `tableware detect`."""

    sizes: Literal["auto", "known", "estimated"] = Field(
        "auto",
        description="Sizes of dishes: known (--dishes, or the standard ones), with stacks and utensils, or "
        "estimated from depth, without these; auto: known where --dishes or a scene gives them",
    )
    depth_scale: float | None = Field(
        None, gt=0, le=1, description="Metres a unit of the depth file; 0.001 for 16-bit images, 1 for arrays of metres"
    )
    camera_height: float = Field(
        0.83,
        ge=0.3,
        le=2.0,
        description="Height above the table [m] of a camera whose file gives no pose, with --overhead",
    )
    overhead: bool = Field(
        False,
        description="The camera looks straight down on the workspace's middle; else its pose is found in the depth",
    )
    workspace_x: float = Field(0.78, ge=0.2, le=1.4, description="Side of the workspace along x [m], of a known pose")
    workspace_y: float = Field(0.61, ge=0.2, le=0.82, description="Side of the workspace along y [m], of a known pose")
    photograph: bool = Field(
        False,
        description="There is no depth: round outlines in colour alone, with unknown heights; nothing can be "
        "planned from them",
    )
    picture_width: float | None = Field(
        None, gt=0.1, le=10, description="How much of the table a photograph's width shows [m]; without it no kinds"
    )


def check_inputs(parameters: DetectParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for options that contradict one another."""
    if parameters.picture_width is not None and not parameters.photograph:
        raise UsageError("--picture-width is for --photograph alone", hint="with depth the scale is known")
    if parameters.photograph and parameters.sizes == "estimated":
        raise UsageError("--sizes estimated needs depth", hint="leave --photograph out")
    if parameters.photograph and (inputs.get("depth") is not None or parameters.overhead):
        raise UsageError("--photograph reads colour alone", hint="leave --photograph out to use the depth")


DETECT = Stage(
    name="tableware detect",
    summary="See what is on a table: dishes, stacks, forks and spoons in an RGB-D image, and what is in doubt",
    parameters=DetectParameters,
    reads={
        "image": External("colour image, or a folder with color.png, depth.png/.npy/.npz and camera.json/scene.json"),
        "depth": Optionally(External("depth image: 16-bit PNG, or .npy/.npz array")),
        "camera": Optionally(External("camera.json: intrinsics, and the pose where it is known (docs/TIDY.md)")),
        "dishes": Optionally(DISHES_FILE),
    },
    writes=TablewareDetections,
    libraries=("numpy", "scipy", "numba", "opencv-python-headless", "trimesh"),
    module="detect_stage",
    argument="image",
    check=check_inputs,
    example="scenewright tableware detect outputs/scene --out outputs/detections",
)
