"""Declaration of the step `library build`."""

from __future__ import annotations

from pydantic import Field

from schemas.cad_library import CadLibrary
from stages.kit.stage import Parameters, Stage


class LibraryParameters(Parameters):
    """Options of `library build`."""

    shapes_per_class: int = Field(4, ge=1, le=99, description="Shapes of every class of furniture")
    small_shapes_per_class: int = Field(4, ge=1, le=99, description="Shapes of every class of small, movable thing")
    classes: tuple[str, ...] = Field((), description="Class names to build; all when empty")


STAGE = Stage(
    name="library build",
    version=1,
    summary="Make a CAD library of parametric furniture, articulated, with collision shapes and masses",
    parameters=LibraryParameters,
    reads={},
    writes=CadLibrary,
    libraries=("numpy", "scipy", "shapely", "trimesh"),
    example="scenewright library build --out outputs/demo/cad_library --seed 0",
)
