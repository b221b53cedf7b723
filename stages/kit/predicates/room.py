"""What a robot perceives of a room of the chain: boxes and joints of its bodies, and the links of its contact graph.

Lengths in metres, world frame, z up. `width` is the smaller horizontal edge of a body's own box, `depth` the larger;
`openness` the largest share of a joint's range that is open; `surface` the area of the largest level plane [m^2].
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.schemas.scene_parts import Box
from scenewright.stages.kit.geometry.transforms import transform_from_quaternion
from scenewright.stages.kit.motion.kinematics import arm_chain, reach, shoulder_height
from scenewright.stages.kit.predicates.vocabulary import Vocabulary
from scenewright.stages.kit.simulation.robot_description import RobotDescription

Point = tuple[float, float, float]
ROOM_WORDS = Vocabulary(
    of_object=(
        *("x", "y", "left", "right", "back", "front", "bottom", "top"),
        *("width", "depth", "height", "openness", "doors", "surface"),
    ),
    of_scene=("reach_low", "reach_high", "hand_opening"),
    relations={"supported": 2, "contained": 2, "held": 1},
)
"""Words that expressions may use of a room and its bodies."""
TOUCH = 0.03
"""Largest distance that `near` allows [m]."""
UNSEEN = ("wall", "ceiling", "surroundings")
"""Classes that nothing is said of."""
REACHED = 0.95
"""Share of the arm's reach that counts, as `plan` has it."""


@dataclass(frozen=True)
class Body:
    """One body: its box along the axes of the world (middle and edges), the edges of its own, and its joints."""

    middle: Point
    edges: Point
    width: float
    depth: float
    category: str
    openness: float = 0.0
    doors: int = 0
    surface: float = 0.0

    def along(self, axis: int, side: float) -> float:
        """Return where the box ends on one side (-1, 0: its middle, 1) of a world axis."""
        return self.middle[axis] + side * self.edges[axis] / 2


SIDES = {
    "x": (0, 0.0),
    "y": (1, 0.0),
    "left": (0, -1.0),
    "right": (0, 1.0),
    "back": (1, -1.0),
    "front": (1, 1.0),
    "bottom": (2, -1.0),
    "top": (2, 1.0),
}
"""Words for the sides of a body: axis, and where along it from -1 (least) to 1."""


@dataclass(frozen=True)
class RoomState:
    """A moment in a room."""

    bodies: dict[str, Body]
    supported: dict[str, str] = field(default_factory=dict)
    """Body -> what carries it."""
    contained: dict[str, str] = field(default_factory=dict)
    held: str = ""
    reach: tuple[float, float] = (0.0, 2.0)
    """Heights between which the arm reaches."""
    hand_opening: float = 0.08

    @property
    def names(self) -> tuple[str, ...]:
        """The bodies."""
        return tuple(self.bodies)

    @property
    def tolerance(self) -> float:
        """What `near` allows."""
        return TOUCH

    def category(self, name: str) -> str:
        """Return the class of a body."""
        return self.bodies[name].category

    def number(self, name: str, call: str) -> float:
        """Return what a perception call says of a body."""
        body = self.bodies[name]
        if call in SIDES:
            return body.along(*SIDES[call])
        return body.edges[2] if call == "height" else float(getattr(body, call))

    def of_scene(self, call: str) -> float:
        """Return what a perception call says of the robot."""
        return {"reach_low": self.reach[0], "reach_high": self.reach[1], "hand_opening": self.hand_opening}[call]

    def related(self, relation: str, names: tuple[str, ...]) -> bool:
        """Whether the contact graph, or the hand, has a relation."""
        if relation == "held":
            return self.held == names[0]
        links = self.supported if relation == "supported" else self.contained
        return links.get(names[0]) == names[1]

    def moved(self, name: str, change: Body) -> RoomState:
        """Return the room with one body changed."""
        return replace(self, bodies={**self.bodies, name: change})


def arm_heights(robot: RobotDescription) -> tuple[float, float]:
    """Return between which heights [m] the arm of a robot reaches from its pedestal, at some distance."""
    chain = arm_chain(robot)
    shoulder, far = robot.pedestal_height + shoulder_height(chain), REACHED * reach(chain)
    return shoulder - far, shoulder + far


def perceive(bodies: Iterable[SceneBody], graph: ContactGraphFile, robot: RobotDescription) -> RoomState:
    """Return what is perceived of the bodies of a scene, as its contact graph has them; walls and ceiling left out."""
    nodes = {node.id: node for node in graph.nodes}
    body_of = {each.name: _body(each, nodes.get(each.name)) for each in bodies if each.class_name not in UNSEEN}
    supported: dict[str, str] = {}
    contained: dict[str, str] = {}
    for link in graph.links:
        if link.target in body_of and link.source in body_of and link.relation in ("supports", "contains"):
            (supported if link.relation == "supports" else contained)[link.target] = link.source
    held_object = graph.graph.get("held", "")
    return RoomState(body_of, supported, contained, held_object, arm_heights(robot), robot.opening)


def _body(record: SceneBody, node: GraphNode | None) -> Body:
    box = record.box if node is None or node.box is None else node.box
    values = dict(record.joint_values)
    if node is not None:
        values |= {f"{record.name}__{name}": value for name, value in node.joints.items()}
    shares = [values.get(joint.name, 0.0) / joint.upper for joint in record.joints if joint.upper > 0]
    level = [plane.area for plane in (() if node is None else node.planes) if plane.horizontal]
    return Body(
        box.center,
        _edges(box),
        width=min(box.size[:2]),
        depth=max(box.size[:2]),
        category=record.class_name,
        openness=max(shares, default=0.0),
        doors=len(record.joints),
        surface=max(level, default=0.0),
    )


def _edges(box: Box) -> Point:
    rotation = transform_from_quaternion(np.array(box.orientation), np.zeros(3))[:3, :3]
    x, y, z = (np.abs(rotation) @ np.array(box.size)).tolist()
    return x, y, z
