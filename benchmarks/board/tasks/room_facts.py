"""What the true room says about tasks: which things a hand takes, which places have room for them.

Rules over boxes, level planes and joints of the truth alone, so that no version of the method changes a task.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.interactive_scene import InteractiveSceneFile, SceneBody
from scenewright.schemas.scene_parts import TREE_RELATIONS, SurfacePlane
from scenewright.stages.kit.geometry.boxes import box_yaw

from benchmarks.board.tasks.true_end import is_shut

WIDEST = 0.078
"""Most that the fingers close on [m]; a Panda's hand opens 80 mm."""
HEAVIEST = 1.0
"""[kg]"""
LOWEST, HIGHEST = 0.35, 1.25
"""Heights [m] between which things are taken and put."""
TABLES = ("table", "desk")
SHELVES = ("shelf", "wall_shelf")
TOPS = ("cabinet", "drawer_unit")
"""Furniture whose top carries things; what it has below is shut."""
CARRIERS = ("tray", "plate")
SIDE, SIDE_INSIDE, ABOVE = 0.05, 0.02, 0.05
"""Free space around a thing that is put down, in the open and in furniture, and over it [m]."""
CELL = 0.04
"""Distance of the places that are tried [m]."""


@dataclass(frozen=True)
class Thing:
    """Something small that the hand takes by itself, as it stands in the true room."""

    name: str
    parent: str
    inside: bool
    """Whether its parent is furniture with doors or drawers that holds it inside."""
    radius: float
    """Of the upright cylinder around it [m]."""
    height: float


@dataclass(frozen=True)
class Level:
    """A level rectangle that carries things."""

    owner: str
    center: np.ndarray
    """(3,)"""
    sides: np.ndarray
    """(2, 2) unit vectors in the plane, one a row."""
    half: np.ndarray
    """(2,) half the lengths along them [m]."""
    headroom: float
    """To the next level of the same furniture, inf under the open sky [m]."""
    inside: bool
    """Whether doors or drawers hide it."""


@dataclass(frozen=True)
class RoomFacts:
    """What tasks are drawn from. Names are true names; tuples are sorted."""

    things: tuple[Thing, ...]
    levels: tuple[Level, ...]
    classes: dict[str, str]
    open_containers: frozenset[str]
    """Furniture of which some door or drawer is not shut."""
    footprints: dict[str, np.ndarray]
    """Body -> (7,) x, y, yaw, half length, half width, bottom, top of its box."""

    def of_class(self, *names: str) -> list[str]:
        """Return what carries or holds things and is of some classes, by name."""
        owners = {level.owner for level in self.levels}
        return sorted(owner for owner in owners if self.classes[owner] in names)

    def fits(self, thing: Thing, owner: str, *, inside: bool) -> bool:
        """Whether a level of a piece of furniture has a free place for a thing."""
        levels = (level for level in self.levels if level.owner == owner and level.inside == inside)
        return any(self._has_place(level, thing) for level in levels)

    def _has_place(self, level: Level, thing: Thing) -> bool:
        if level.headroom < thing.height + ABOVE:
            return False
        radius = thing.radius + (SIDE_INSIDE if level.inside else SIDE)
        others = [
            print_
            for name, print_ in self.footprints.items()
            if name not in (thing.name, level.owner)
            and print_[6] > level.center[2] + 0.01
            and print_[5] < level.center[2] + thing.height + ABOVE
        ]
        places = (level.center[:2] + offset @ level.sides for offset in _grid(level.half - radius))
        return any(all(_distance(place, other) > radius for other in others) for place in places)


def room_facts(room: Path, graph: ContactGraphFile, seen: Iterable[str]) -> RoomFacts:
    """Return what is true of a room whose bodies lie in the folder `room`. `seen`: what the camera saw enough of."""
    records = {body.name: body for body in InteractiveSceneFile.read(room / "scene.json").bodies}
    noticed = set(seen) & set(records)
    tree = {link.target: link for link in graph.links if link.relation in TREE_RELATIONS}
    loaded = {link.source for link in graph.links if link.relation != "proximal"}
    things = []
    for name in sorted(noticed - loaded):
        record, link = records[name], tree.get(name)
        if link is not None and _is_small(record) and record.class_name not in CARRIERS:
            holds = bool(link.source in records and records[link.source].joints) and link.relation == "contains"
            size = record.box.size
            things.append(Thing(name, link.source, holds, max(size[0], size[1]) / 2, size[2]))
    levels = [level for name in sorted(noticed) for level in _levels(records[name], graph.node(name).planes)]
    ajar = {name for name, record in records.items() if not all(_shut(record).values())}
    classes = {name: record.class_name for name, record in records.items()}
    prints = {name: _footprint(record) for name, record in records.items() if _stands_in_room(record)}
    return RoomFacts(tuple(things), tuple(levels), classes, frozenset(ajar), prints)


def _is_small(record: SceneBody) -> bool:
    width, bottom = record.grasp_width, record.box.center[2] - record.box.size[2] / 2
    if not record.carriable or width is None or record.mass > HEAVIEST:
        return False
    return width <= WIDEST and LOWEST <= bottom <= HIGHEST


def _shut(record: SceneBody) -> dict[str, bool]:
    return {joint.name: is_shut(joint, record.joint_values.get(joint.name, 0.0)) for joint in record.joints}


def _stands_in_room(record: SceneBody) -> bool:
    return record.class_name not in ("floor", "wall", "ceiling")


def _levels(record: SceneBody, planes: Iterable[SurfacePlane]) -> Iterator[Level]:
    """Yield the levels of a body that tasks may name, at a height that the arm reaches."""
    rectangles = (plane for plane in planes if plane.horizontal and len(plane.corners) == 4)
    flat = sorted(rectangles, key=lambda plane: plane.center[2])
    carried = record.class_name in (*TABLES, *SHELVES, *TOPS, *CARRIERS)
    for number, plane in enumerate(flat):
        height, top = plane.center[2], number == len(flat) - 1
        inside = bool(record.joints) and not top
        if not LOWEST <= height <= HIGHEST or not (inside or carried):
            continue
        above = [other.center[2] - height for other in flat[number + 1 :] if other.center[2] > height + 0.03]
        corners = np.array(plane.corners)
        edges = corners[[1, 3]] - corners[0]
        lengths = np.linalg.norm(edges, axis=1)
        if lengths.min() > 0:
            middle = corners.mean(axis=0)
            sides = edges[:, :2] / lengths[:, None]
            yield Level(record.name, middle, sides, lengths / 2, min(above, default=np.inf), inside)


def _footprint(record: SceneBody) -> np.ndarray:
    box = record.box
    (x, y, z), (length, width, height) = box.center, box.size
    return np.array([x, y, box_yaw(box), length / 2, width / 2, z - height / 2, z + height / 2])


def _distance(place: np.ndarray, footprint: np.ndarray) -> float:
    """Return how far a point (2,) is from a body's rectangle [m], 0 within it."""
    cosine, sine = np.cos(footprint[2]), np.sin(footprint[2])
    away = np.array([[cosine, sine], [-sine, cosine]]) @ (place - footprint[:2])
    return float(np.linalg.norm(np.maximum(np.abs(away) - footprint[3:5], 0.0)))


def _grid(half: np.ndarray) -> np.ndarray:
    """Return offsets (N, 2) of places in a rectangle of half lengths (2,), its middle among them; (0, 2) for none."""
    if half.min() < 0:
        return np.zeros((0, 2))
    steps = [CELL * np.arange(-int(length / CELL), int(length / CELL) + 1) for length in half]
    return np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 2)
