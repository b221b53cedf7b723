"""Kind `cad_library`: parametric and imported furniture, ready for matching and for simulation."""

from __future__ import annotations

from typing import ClassVar

from schemas.artifact import Artifact
from schemas.base import Model, Name, Vector3
from schemas.scene_parts import Joint, SurfacePlane


class ModelState(Model):
    """The shape of a model at one set of joint values. Matching tries every state."""

    joints: dict[str, float]
    """Joint name -> value; empty for rigid models."""
    box_minimum: Vector3
    box_maximum: Vector3
    planes: tuple[SurfacePlane, ...]
    """Surface planes in the model frame; the `horizontal` ones are support surfaces."""


class CadModel(Model):
    """One CAD model. Model frame: metres, z up, front along -y, origin at the centre of the bottom
    of the closed (all joints 0) bounding box."""

    id: Name
    class_name: str
    articulated: bool
    mass: float
    """Total mass [kg] at scale 1."""
    states: tuple[ModelState, ...]
    """First the closed one."""
    joints: tuple[Joint, ...] = ()
    movable: bool
    contains: bool = False
    """Whether things can be put inside."""
    grasp_width: float | None = None
    """Horizontal extent that a two-finger gripper can close on [m], for movable models."""
    parts: tuple[Name, ...]
    """Link names; the first is the body."""
    recipe: dict[str, float | int | str] = {}
    """Generator and its parameters, or the source file of an import."""


class LibraryFile(Model):
    """library.json."""

    seed: int
    models: tuple[CadModel, ...]


class ImportedModel(Model):
    """What `library add` found out about one model of other people, and what it did not like."""

    id: str
    """Id of the model in library.json; empty when it was left out."""
    name: str
    source: str
    """Path of its file below the folder that was imported."""
    format: str
    class_name: str
    size: Vector3 | None
    """Closed bounding box [m]: across, deep, high."""
    unit: float | None
    """Metres per unit of the file, or of its meshes where those declare one."""
    unit_from: str
    up: str
    """Axis of the file that points up."""
    up_from: str
    front: str
    """Axis of the file that points to the front."""
    front_from: str
    joints: int
    """Movable joints that were kept."""
    collision_pieces: int
    can_be_carried: bool
    can_be_opened: bool
    can_contain: bool
    can_support: bool
    """Whether it has a horizontal surface to put things on, closed."""
    has_handle: bool
    """Whether a place to grasp is known on one of its moving parts."""
    findings: tuple[str, ...]


class ImportFile(Model):
    """imports.json."""

    models: tuple[ImportedModel, ...]


class CadLibrary(Artifact):
    """`library.json`, and per model a self-contained folder `models/<id>/`: `model.json` (its CadModel), `model.urdf`
    (meshes by relative path), `visual/<part>.glb` (vertex colours) and `visual/<part>_<k>.obj` (the same, one file a
    colour: what the URDF names, because pybullet refuses GLB), `collision/<part>_<k>.obj` (convex). Meshes are in the
    part frame: origin at the joint, axes of the model frame at joint value 0; the body's is the model frame.
    `imports.json` lists the models that `library add` read, and what it found out about them."""

    kind: ClassVar[str] = "cad_library"
    description: ClassVar[str] = "CAD models: URDF, visual and convex collision meshes, planes, joints, affordances"
    json_files: ClassVar[dict[str, type[Model]]] = {"library.json": LibraryFile}
    optional_json_files: ClassVar[dict[str, type[Model]]] = {"imports.json": ImportFile}

    @property
    def library(self) -> LibraryFile:
        """The parsed library.json."""
        return LibraryFile.read(self.path("library.json"))
