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


STAGE = Stage(
    name="urdf",
    version=1,
    summary="Convert the CAD scene into a kinematic tree: URDF for simulators and robots, MJCF beside it",
    parameters=UrdfParameters,
    reads={"cad_scene": CadScene},
    writes=InteractiveScene,
    libraries=("numpy", "scipy", "trimesh"),
    example="scenewright urdf --cad-scene outputs/demo/cad_scene --out outputs/demo/interactive_scene",
)
