"""Kind `cad_library`: parametric and imported furniture, ready for matching and for simulation."""

from __future__ import annotations

from typing import ClassVar, Literal

from scenewright.schemas.artifact import Artifact, Document, OptionalDocument
from scenewright.schemas.base import Model, Name, Seed, Vector3
from scenewright.schemas.scene_parts import Joint, SurfacePlane


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


JointKind = Literal["door", "drawer", "lid", "knob", "lever", "slide"]
"""Doors, drawers and lids open something; knobs turn about their own middle, levers are small and turn; the rest that
slides is a `slide`."""


class JointUse(Model):
    """What a joint of a model is for."""

    joint: str
    part: str
    kind: JointKind
    behind: tuple[str, ...] = ()
    """Joints that have to be open before this one can (a rack behind the door of an oven)."""


class InnerVolume(Model):
    """Room in a model where things can be put: a box in the model frame, closed, at scale 1."""

    part: str
    """On whose floor they stand; the room moves with it."""
    box_minimum: Vector3
    box_maximum: Vector3
    plane: int
    """Index of the floor in the planes of the closed state."""
    reached_through: tuple[str, ...] = ()
    """Joints to open before a hand gets in; empty for a bowl or an open shelf."""


class SupportSurface(Model):
    """A surface that things can stand on."""

    plane: int
    """Index in the planes of the closed state."""
    part: str
    area: float
    """Of the region that nothing covers [m^2]."""
    clearance: float | None = None
    """Free height above its middle [m]; None up to the open air."""
    inside: bool = False
    """Whether it is the floor of an inner volume."""


class GraspPlace(Model):
    """Where a two-finger gripper can take hold, model frame, closed, at scale 1."""

    part: str
    joint: str | None = None
    """The joint that is moved by it; None when the whole thing is lifted."""
    point: Vector3
    axis: Vector3 | None = None
    """Direction of the bar that the fingers close around."""
    width: float | None = None
    """Between the fingers [m], where known."""


class Affordances(Model):
    """What can be done with a model, derived from its geometry and its joints."""

    model: Name
    movable: bool
    openable: tuple[str, ...] = ()
    """Names of the joints that open something: doors, drawers, lids."""
    joints: tuple[JointUse, ...] = ()
    contains: tuple[InnerVolume, ...] = ()
    """Largest first."""
    carries: tuple[SupportSurface, ...] = ()
    """Largest first."""
    grasps: tuple[GraspPlace, ...] = ()


class LibraryFile(Model):
    """library.json."""

    seed: Seed
    models: tuple[CadModel, ...]
    affordances: tuple[Affordances, ...] = ()
    """In the order of the models; those of a library from before they were derived have none."""


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
    info = Document(LibraryFile, "library.json")
    imports = OptionalDocument(ImportFile, "imports.json")
