"""Declaration of the step `urdf`."""

from __future__ import annotations

from pydantic import Field
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.stages.kit.estimates import grows_with
from scenewright.stages.kit.stage import Parameters, Stage


class UrdfParameters(Parameters):
    """Options of `urdf`."""

    movable_classes: tuple[str, ...] = Field(
        (), description="Further classes that an arm carries (default: vocabulary); furniture is free too"
    )
    fixed_classes: tuple[str, ...] = Field(
        (), description="Classes that stay where they are, although an arm carries them or they are furniture"
    )
    rest: bool = Field(True, description="Lay movable bodies down that come to rest within 1 cm and 5 degrees")
    settle_seconds: float = Field(3.0, ge=0, le=30, description="Simulated time of the settle test, 0 for none [s]")
    settle_distance: float = Field(0.01, gt=0, description="A movable body that moves further does not stay [m]")
    settle_angle: float = Field(2.0, gt=0, le=180, description="A movable body that turns more does not stay [degrees]")


STAGE = Stage(
    name="urdf",
    version=12,
    summary="Convert the CAD scene into a kinematic tree: URDF for simulators and robots; MJCF, SRDF, GLB, MCAP",
    parameters=UrdfParameters,
    reads={"cad_scene": CadScene},
    writes=InteractiveScene,
    libraries=("numpy", "scipy", "trimesh", "shapely", "python-fcl", "pybullet", "mcap", "mcap-protobuf-support"),
    example="scenewright urdf --cad-scene outputs/demo/cad_scene --out outputs/demo/interactive_scene",
    estimate=grows_with("cad_scene", 0.0, 2.1, 130, 23.0),
)
