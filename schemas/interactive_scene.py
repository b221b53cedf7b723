"""Kind `interactive_scene`: what simulators and robots load (Han 2024, section 2.4.5)."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field
from scenewright.schemas.artifact import Artifact, Document, OptionalDocument
from scenewright.schemas.base import Model, Name, RelativePath, Transform, Vector3
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.scene_parts import Box, Joint


class SceneBody(Model):
    """One node of the scene as links: in scene.urdf and static.urdf all links are prefixed `<name>__<part>`,
    the body link is `<name>`."""

    name: Name
    """Node id of the contact graph, or `surroundings`: what was mapped and has no name, static."""
    class_name: str
    movable: bool
    """Movable bodies hang on floating joints in scene.urdf and have a file of their own."""
    furniture: bool = Field(default=False, exclude_if=lambda value: not value)
    """Movable, but nothing that an arm carries: a chair, a screen, a lamp. Absent otherwise."""
    file: RelativePath | None = None
    """`bodies/<name>.urdf` for movable bodies, None for those in static.urdf."""
    parent: str | None = None
    relation: str = "supports"
    """To its parent; `unknown`: nothing is known to carry it, and `because` says why."""
    world_from_body: Transform
    world_from_reconstructed: Transform | None = Field(None, exclude_if=lambda pose: pose is None)
    """Where the body frame was before physics laid the body down, when that changed its pose. Absent otherwise."""
    joints: tuple[Joint, ...] = ()
    """Scaled; `name` and `part` carry the `<name>__` prefix of the URDF; origin, axis, handle in the body frame."""
    joint_values: dict[str, float] = {}
    """Prefixed joint name -> value in which the scene was reconstructed."""
    box: Box
    """World frame."""
    mass: float
    contains: bool = False
    grasp_width: float | None = None
    because: str = Field(default="", exclude_if=lambda value: not value)
    """`inferred: ...`: what of its shape nobody saw, and why it has to be there (its visual shapes are called
    `inferred_<number>.obj`); `held: ...`: why it is fixed although it could be pushed. Absent otherwise."""

    @property
    def carriable(self) -> bool:
        """Whether it is free, and small and light enough for an arm."""
        return self.movable and not self.furniture


class Spawn(Model):
    """A place on the floor for a robot's base."""

    world_from_base: Transform
    """On the floor, x towards the middle of what stands about."""
    radius: float
    """Nothing stands nearer than this [m]."""


class Light(Model):
    """The lamp that lights the scene in simulators; it is assumed, as maps show no lamps."""

    position: Vector3
    """World frame [m]."""


class Doubt(Model):
    """Something that nobody should trust."""

    name: Name
    """Of a body, or `scene`."""
    says: str
    """What, and why."""


class InteractiveSceneFile(Model):
    """scene.json: how to load the scene. Physics engines that know no floating joints load `static_file` with a
    fixed base and then each movable body at world_from_body."""

    combined_file: RelativePath = "scene.urdf"
    static_file: RelativePath = "static.urdf"
    bodies: tuple[SceneBody, ...]
    spawn: Spawn | None = Field(default=None, exclude_if=lambda place: place is None)
    """Where a robot has most room on the floor that was seen. Absent where there is none."""
    light: Light | None = Field(default=None, exclude_if=lambda light: light is None)
    """Also in MJCF, SDF and USD. Absent in older scenes."""
    doubts: tuple[Doubt, ...] = Field(default=(), exclude_if=lambda doubts: not doubts)
    """What of it is inferred, held, hardly explained or assumed. Absent in older scenes and in true ones."""


class SettledBody(Model):
    """What became of a movable body that was let go."""

    name: Name
    moved: float
    """[m]"""
    turned: float
    """[rad]"""
    leaves: float | None = None
    """When it first was farther from where it stood than it may be [s]; None: it stays."""
    fell_through: bool = False
    poses: tuple[tuple[float, float, float, float, float, float, float], ...] = ()
    """Of its frame in the world at each of the times, x y z [m] and quaternion x y z w; none where it hardly moved."""


class SettleFile(Model):
    """settle.json: the settle test as it went, to be looked at."""

    times: tuple[float, ...]
    """[s]"""
    bodies: tuple[SettledBody, ...]
    troubles: tuple[str, ...] = ()
    """What else is wrong, in words: pairs that lie in each other, joints that meet something."""
    verdict: str
    reason: str
    margin: float | None = Field(default=None, exclude_if=lambda value: value is None)
    """Of the verdict, as in `margins`. Absent where nothing that could turn it is near its threshold."""
    margins: dict[str, float] = Field(default={}, exclude_if=lambda value: not value)
    """Body, joint, or `LINK in LINK` -> distance to the threshold of what is said of it, in standard deviations of
    eight runs from poses that are 0.1 mm and 0.01 degrees apart; below 2 it is marginal. Absent for what is far."""


class InteractiveScene(Artifact):
    """`scene.urdf` (whole kinematic tree, root link `world`), `static.urdf`, `bodies/<name>.urdf`, `scene.json`,
    `graph.json` (cg'), `meshes/`; beside it `scene.mjcf.xml`, `scene.srdf`, `scene.glb` and `scene.mcap`.
    `settle.json`: how the settle test went, where one was made."""

    kind: ClassVar[str] = "interactive_scene"
    description: ClassVar[str] = "URDF scene: whole kinematic tree, static tree, one file per movable body"
    info = Document(InteractiveSceneFile, "scene.json")
    graph = Document(ContactGraphFile, "graph.json")
    settling = OptionalDocument(SettleFile, "settle.json")
