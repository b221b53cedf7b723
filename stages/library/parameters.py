"""Declarations of the steps `library build` and `library add`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field
from scenewright.schemas.cad_library import CadLibrary
from scenewright.stages.kit.estimates import Estimate, Inputs
from scenewright.stages.kit.known_names import AxisName, UnitName
from scenewright.stages.kit.stage import External, Optionally, Parameters, Stage


class LibraryParameters(Parameters):
    """Options of `library build`."""

    shapes_per_class: int = Field(4, ge=1, le=99, description="Shapes of every class of furniture")
    small_shapes_per_class: int = Field(4, ge=1, le=99, description="Shapes of every class of small, movable thing")
    classes: tuple[str, ...] = Field((), description="Class names to build; all when empty")


class AdditionParameters(Parameters):
    """Options of `library add`."""

    class_name: str = Field("", description="Class of all models; without it the names of models and folders tell")
    unknown: Literal["skip", "object"] = Field("skip", description="What becomes of models whose class nothing tells")
    unit: Literal["declared", UnitName] = Field(
        "declared",
        description="Unit of the files, whatever they declare; of the mesh files that a URDF, SDF or MJCF names",
    )
    up: Literal["declared", AxisName] = Field(
        "declared", description="Axis of the files that points up, whatever they declare"
    )
    front: Literal["declared", AxisName] = Field(
        "declared", description="Axis of the files that points to the front, whatever they declare"
    )
    collision: Literal["given", "visual"] = Field(
        "given", description="Take collision shapes from those of the file where it has some, or from what is drawn"
    )
    decomposition: Literal["auto", "coacd", "hulls"] = Field(
        "auto", description="Cut hollow pieces up with CoACD, or fill them by their hulls; auto: CoACD where installed"
    )
    density: float = Field(
        250.0, gt=0, le=20000, description="Density of models without a mass, over their collision pieces [kg/m^3]"
    )


def _estimate(parameters: LibraryParameters, inputs: Inputs) -> Estimate:
    classes = len(parameters.classes) or 51
    models = classes * (parameters.shapes_per_class + parameters.small_shapes_per_class) / 2
    return Estimate(0.08 * models, 0.01 * models, 190)


BUILD = Stage(
    name="library build",
    summary="Make a CAD library of parametric furniture, articulated, with collision shapes and masses",
    parameters=LibraryParameters,
    reads={},
    writes=CadLibrary,
    libraries=("numpy", "scipy", "shapely", "trimesh"),
    example="scenewright library build --out outputs/demo/cad_library --seed 0",
    estimate=_estimate,
)

ADD = Stage(
    name="library add",
    summary="Import models of other people into a CAD library: URDF, MJCF, SDF, meshes, PartNet, ShapeNetSem",
    parameters=AdditionParameters,
    reads={
        "models": External("folder of models to import"),
        "library": Optionally(CadLibrary),
        "mapping": Optionally(External("TOML file: class, unit, up and front of single models by name")),
    },
    writes=CadLibrary,
    libraries=("numpy", "scipy", "shapely", "trimesh", "opencv-python-headless"),
    module="addition",
    argument="models",
    example="scenewright library add furniture/ --out outputs/imported",
    data_files=lambda parameters: ("imported_models.toml", "labels/words.toml"),
    versions="importing.versions",
)

STAGES = (BUILD, ADD)
