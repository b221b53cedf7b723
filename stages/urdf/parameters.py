"""Declaration of the step `urdf`."""

from __future__ import annotations

from pydantic import Field

from schemas.cad_scene import CadScene
from schemas.interactive_scene import InteractiveScene
from stages.kit.stage import Parameters, Stage


class UrdfParameters(Parameters):
    """Options of `urdf`."""

    movable_classes: tuple[str, ...] = Field(
        (), description="Further classes to put on floating joints (default: vocabulary)"
    )
    fixed_classes: tuple[str, ...] = Field((), description="Classes to fix although the vocabulary calls them movable")
    settle_seconds: float = Field(1.0, ge=0, le=30, description="Simulated time of the settle test, 0 for none [s]")
    settle_distance: float = Field(0.05, gt=0, description="A movable body that moves further is called unstable [m]")


STAGE = Stage(
    name="urdf",
    version=2,
    summary="Convert the CAD scene into a kinematic tree: URDF for simulators and robots, MJCF beside it",
    parameters=UrdfParameters,
    reads={"cad_scene": CadScene},
    writes=InteractiveScene,
    libraries=("numpy", "scipy", "trimesh", "pybullet"),
    example="scenewright urdf --cad-scene outputs/demo/cad_scene --out outputs/demo/interactive_scene",
)
