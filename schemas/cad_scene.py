"""Kind `cad_scene`: the functionally equivalent scene cg' (Han 2024, section 2.4)."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field
from scenewright.schemas.artifact import Artifact, Document, OptionalDocument
from scenewright.schemas.base import Model, Name, Transform, Vector3
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.edits import AppliedEditsFile


class CadCandidate(Model):
    """One aligned candidate: CAD model, state and pose."""

    model_id: Name
    joints: dict[str, float] = {}
    scale: float
    world_from_model: Transform
    """Rigid part, without the scale: p_world = world_from_model * (scale * p_model)."""
    matching_error: float
    """Equation 2.7."""
    alignment_error: float
    """Root mean square distance from object vertices to the CAD surface [m]."""
    score: float | None = Field(default=None, exclude_if=lambda score: score is None)
    """What the choice minimises [m]: the alignment error, and what it costs that points do not tell. In older scenes
    absent."""
    explained: float | None = Field(default=None, exclude_if=lambda share: share is None)
    """Share of what was seen that it explains where it is; of what was chosen and the next two models."""
    stretched_from: Name | None = Field(default=None, exclude_if=lambda source: source is None)
    """The model of the library that it was stretched from; None, and absent from the file, where it is one itself."""

    @property
    def library_model(self) -> str:
        """The model of the library that this one is, or was."""
        return self.stretched_from or self.model_id


Ground = Literal["user", "moved", "open", "handle", "seam", "thing"]
"""Why a joint is believed: somebody vouched for it; the log shows its part move; its part was seen open; a handle
stands out of its leaf; a seam runs where its leaf ends; or another joint of the same thing has one of these, and this
one was not seen."""


class SeenMotion(Model):
    """How the log shows a joint of a chosen model move. Model frame, scale 1."""

    axis: Vector3
    """Unit vector, in the direction in which the model's own joint opens."""
    angle: float
    """Between it and the axis of the model's joint [rad]."""
    travel: float
    """From the one state seen to the other [rad] or [m], positive."""
    upper: float
    """The farthest that it was seen open, counted from the model's shut state [rad] or [m]."""


class JointEvidence(Model):
    """What the map says for a joint of a chosen model."""

    grounds: tuple[Ground, ...] = ()
    """None: the joint is not believed, its part stays where it is."""
    handle_height: float | None = None
    """How far the handle that was found stands out of the leaf [m]."""
    seam_contrast: float | None = None
    """Share of the leaf's clearest inner edge along which a seam was found."""
    motion: SeenMotion | None = Field(default=None, exclude_if=lambda motion: motion is None)
    """How it was seen to move; the joint of the scene has this axis, and reaches at least as far."""


class Inferred(Model):
    """What nobody saw of a thing: added to a mesh, which would not stand else, or part of a model of a family."""

    what: str
    """Legs, a bottom, depth; empty where nothing has room: then the thing is held."""
    because: str
    """Why."""
    pieces: tuple[tuple[Vector3, ...], ...] = ()
    """Corners of the convex pieces, world frame [m]. All of their faces are inferred, none was seen. To a mesh they are
    added; a model of a family has them."""


class Explained(Model):
    """How much of the surface that was seen of a thing lies near what stands for it, by area (`explained_within`)."""

    area: float
    """Of what was seen [m²]."""
    by_model: float
    """Share that lies near the chosen model; 0 where it keeps its mesh."""
    by_mesh: float
    """Share that lies near its own mesh: 1 but for a mesh that was moved farther; 0 where a model stands for it."""


Way = Literal["library", "stretched", "by_shape", "family", "built_in"]
"""How something is sought that may stand for a thing: a model of the library of its class; one stretched along its own
axes; one of the class that its shape tells; parts of a family of furniture; boxes made for it."""


class Tried(Model):
    """What came of one way."""

    way: Way
    because: str
    """Why it gives this, or nothing; empty where nothing is to be said."""
    model_id: Name | None = None
    """What it puts first; None where it gives nothing new."""
    score: float | None = None
    """What that costs [m]: what the choice among candidates minimises."""


class Replacement(Model):
    """What stands for one graph node."""

    node: Name
    decision: Literal["cad", "mesh", "layout"]
    """`mesh`: no valid candidate, the reconstructed mesh stays; `layout`: never replaced."""
    reason: str = ""
    """Why not `cad`, with numbers."""
    chosen: CadCandidate | None = None
    """Where it stands after the global check."""
    best_single: CadCandidate | None = None
    """What fitted this node best by itself, before the global check and before it was put on its support."""
    part_colors: dict[str, tuple[int, int, int]] = {}
    """Part of the chosen model -> colour (sRGB, 0 to 255) that the map shows there; parts nobody saw are absent."""
    alternatives: tuple[CadCandidate, ...] = ()
    rejected: dict[str, int] = {}
    """Reason -> number of candidates discarded."""
    tries: tuple[Tried, ...] = Field(default=(), exclude_if=lambda tries: not tries)
    """In which ways something was sought, in order; where none gave anything, its own mesh stays."""
    stays: str = Field(default="", exclude_if=lambda words: not words)
    """Why it is held where it stands, or free to move, as far as the scene says; `urdf` may know better."""
    inferred: Inferred | None = Field(default=None, exclude_if=lambda inferred: inferred is None)
    """What is added to the mesh, or what of a model of a family nobody saw. Absent where all was seen, or enough."""
    explained: Explained | None = Field(default=None, exclude_if=lambda explained: explained is None)
    """How much of what was seen of it that explains. Absent for layout, and where nobody asked (older scenes)."""
    joint_evidence: dict[str, JointEvidence] | None = Field(default=None, exclude_if=lambda evidence: evidence is None)
    """Joint of the chosen model -> why it is believed. Absent where nobody asked (older scenes, `--method thesis`):
    then all joints are."""

    @property
    def motions(self) -> dict[str, SeenMotion]:
        """Joints of the chosen model that were seen to move."""
        return {name: entry.motion for name, entry in (self.joint_evidence or {}).items() if entry.motion is not None}

    @property
    def held(self) -> frozenset[str]:
        """Joints of the chosen model that are not believed."""
        return frozenset(name for name, entry in (self.joint_evidence or {}).items() if not entry.grounds)


SURROUNDINGS = "surroundings"
"""The body that is made of what was mapped and has no name; it is no node of the graph."""
UNEXPLAINED = "unexplained.ply"
"""The surface of the map that no model, mesh, layout or surroundings of the scene lies near to."""


class CadSceneFile(Model):
    """scene.json."""

    replacements: tuple[Replacement, ...]
    conflicts_before: int
    """Colliding pairs with the best candidate of each object."""
    conflicts_after: int
    iterations: int
    """Steps of min-conflicts."""
    explained_within: float | None = Field(default=None, exclude_if=lambda distance: distance is None)
    """Surface so near is explained [m]: 2 cm and as much as depth spreads about planes of the map."""
    light_gain: float | None = Field(default=None, exclude_if=lambda gain: gain is None)
    """By how much linear light was multiplied in all colours of the scene, so that walls reflect 65 % (EN 12464-1);
    absent where colours are those of the map."""


class ShellHinge(Model):
    """How a door of the shell turns about one of its upright edges."""

    at_left: bool
    """About its left edge, seen from the room; else about the right one."""
    angle: float
    """At which it was seen, positive into the room; 0 is shut [rad]."""
    because: str
    """Why there: seen, or inferred."""


class ShellPanel(Model):
    """A plate of the room's shell: wall, floor or ceiling, behind its face towards the room, with its holes."""

    node: Name
    """The layout node that it is of; `shell/<node>.ply` is the closed surface of all plates of a node."""
    world_from_panel: Transform
    """x along the face, y across it (of a wall up), z into the room; the face is at z = 0."""
    thickness: float
    """[m], away from the room."""
    boxes: tuple[tuple[float, float, float, float], ...]
    """What is full of it: left, low, right, top in x and y [m]."""
    open_area: float
    """Of its holes [m²]: where cameras looked through, or a door or window has its own node."""
    seen: float
    """Share of its full face that was seen; the rest is inferred, as far as the walls beside it, floor and ceiling."""
    hinge: ShellHinge | None = Field(default=None, exclude_if=lambda hinge: hinge is None)
    """Of a door: the plate is where it would be shut. Absent for what does not turn."""


class ShellFile(Model):
    """shell.json: the plates that close the room."""

    panels: tuple[ShellPanel, ...]


class CadScene(Artifact):
    """`scene.json`, `graph.json` (cg': the contact graph with model, pose, scale, joints per node, boxes and
    planes of the CAD models), `models/<id>/` (copies of the chosen library models), `meshes/<node>.ply` (nodes
    that keep their mesh), `layout/<node>.ply`, `shell.json` and `shell/<node>.ply` (the plates that floor, walls and
    ceiling are, closed; absent where the map tells no layout), `meshes/surroundings.ply` (what the map shows and
    has no name; absent when there is nothing), `unexplained.ply` (what the map shows and nothing in the scene lies
    near to; absent when there is nothing), `edits.json` (what became of each edit, where people put it right)."""

    kind: ClassVar[str] = "cad_scene"
    description: ClassVar[str] = "CAD replacement: model, pose, scale, errors and alternatives per node"
    info = Document(CadSceneFile, "scene.json")
    graph = Document(ContactGraphFile, "graph.json")
    shell = OptionalDocument(ShellFile, "shell.json")
    edits = OptionalDocument(AppliedEditsFile, "edits.json")
