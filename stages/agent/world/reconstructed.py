"""Rooms of the chain as apartments: a true room to live in, a reconstructed one to know before anything was looked at.

Both are scenes of links (`scene.json`), read the same way. What stands on the floor becomes upright boxes along the
axes of the room, as it stands (an open door belongs to its box); what an arm can carry lies on or in them. What hangs
on walls and what stands on furniture without being carriable is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scenewright.schemas.apartment import LARGEST_SIDE, Apartment, Furniture, Room, Thing
from scenewright.schemas.errors import BadInput
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.interactive_scene import InteractiveSceneFile, SceneBody
from scenewright.stages.agent.obstacle_map import CELL
from scenewright.stages.agent.scene_map import Mapped
from scenewright.stages.agent.senses import Detection, SeenFurniture, Sweep
from scenewright.stages.agent.world.floor import Floor
from scenewright.stages.kit.geometry.transforms import transform_from_quaternion
from scipy.ndimage import distance_transform_edt

SHELL = ("floor", "wall", "ceiling")
LEAST = 0.1
"""What is smaller or lower than this is no furniture [m]."""
HANGS = 0.5
"""What begins higher over the floor hangs on a wall, whatever carries it in the graph [m]."""
OPENED = 0.5
"""Share of its range from which on a door counts as open."""


def apartment_of(bodies: Sequence[SceneBody], where: str) -> Apartment:
    """Return a scene as an apartment of one room; the robot stands where it has most room around it.

    Raises BadInput for a scene without a floor, or with one that no apartment has. `where`: what to call it then.
    """
    floors = [body for body in bodies if body.class_name == "floor"]
    if not floors:
        raise BadInput(f"{where}: no body is a floor", hint="reconstruct a room with its floor, or use --world")
    low, high = _extent(max(floors, key=lambda body: body.box.size[0] * body.box.size[1]))
    if np.any(high[:2] - low[:2] < 1.0) or np.any(high[:2] - low[:2] > LARGEST_SIDE):
        raise BadInput(
            f"{where}: the floor is {high[0] - low[0]:.1f} x {high[1] - low[1]:.1f} m", hint="1 to 30 m a side"
        )
    room = Room(name="room_0", low=_point(low), high=_point(high))
    shell = {body.name for body in bodies if body.class_name in SHELL}
    standing = {b.name: b for b in bodies if b.parent in shell and b.relation == "supports" and not b.carriable}
    roots = {body.name: body.parent for body in bodies}
    carried = [(b, on) for b in bodies if b.carriable and (on := _on(b.name, roots, set(standing)))]
    furniture = [_furniture(b, [c for c, on in carried if on == b.name], room) for b in standing.values()]
    furniture_names = {piece.name for piece in furniture if piece is not None}
    reconstructed = Apartment(
        rooms=(room,),
        doors=(),
        furniture=tuple(piece for piece in furniture if piece is not None),
        things=tuple(_thing(body, on) for body, on in carried if on in furniture_names),
        start=(*_point((low + high) / 2), 0.0),
    )
    return reconstructed.model_copy(update={"start": roomiest(reconstructed)})


def lived_in(truth: GroundTruth) -> tuple[Apartment, Path]:
    """Return the true room of a generated log as an apartment, and the folder of its scene. Raises BadInput for a scan,
    of which there is no room."""
    room = truth.path("room")
    if truth.info.source == "scan":
        raise BadInput(
            f"{truth.root}: the truth of a scan has no room to live in",
            hint="give the ground truth of a room that `scenewright synthesize` made",
        )
    return apartment_of(InteractiveSceneFile.read(room / "scene.json").bodies, str(truth.root)), room


def truth_of(truth: GroundTruth | None) -> str:
    """Return the content digest by which an episode names the true room that it happened in; empty without one."""
    return truth.manifest.content_digest if truth is not None and truth.manifest is not None else ""


def mapped(known: Apartment) -> Mapped:
    """Return what a robot believes that is given an apartment as its map."""
    names = [piece.name for piece in known.furniture]
    pieces = [SeenFurniture(f.label, f.centre, f.size, f.height, f.door, f.opened) for f in known.furniture]
    numbered_detections = []
    for thing in known.things:
        number = names.index(thing.on)
        at = (*thing.at, pieces[number].height + 0.02)
        numbered_detections.append((number, Detection(thing.label, at, thing.color, None, thing.radius)))
    return Mapped(Sweep(*Floor(known).cells(), tuple(pieces)), tuple(numbered_detections))


def roomiest(apartment: Apartment) -> tuple[float, float, float]:
    """Return the pose (x, y [m], yaw 0) that is farthest from everything."""
    free, _ = Floor(apartment).cells()
    low = free.min(axis=0) - 1
    grid = np.zeros(free.max(axis=0) - low + 2, bool)
    grid[tuple((free - low).T)] = True
    i, j = np.unravel_index(int(distance_transform_edt(grid).argmax()), grid.shape)
    return round(float((i + low[0]) * CELL), 3), round(float((j + low[1]) * CELL), 3), 0.0


def _extent(body: SceneBody) -> tuple[np.ndarray, np.ndarray]:
    """Return lower and upper corner (3,) of a body's box along the axes of the room [m]."""
    half = (
        np.abs(transform_from_quaternion(np.array(body.box.orientation), np.zeros(3))[:3, :3])
        @ np.array(body.box.size)
        / 2
    )
    centre = np.array(body.box.center)
    return centre - half, centre + half


def _point(values: np.ndarray) -> tuple[float, float]:
    return round(float(values[0]), 3), round(float(values[1]), 3)


def _on(name: str, parents: dict[str, str | None], standing: set[str]) -> str:
    """Return the furniture that a body is on or in, through what carries it; empty without one."""
    at: str | None = name
    for _ in parents:
        at = parents.get(at or "")
        if at is None or at in standing:
            return at or ""
    return ""


def _furniture(body: SceneBody, carried: list[SceneBody], room: Room) -> Furniture | None:
    """Return a body as furniture, cut to the room; its height is where the arm works: its top, or the highest level on
    which something is inside."""
    low, high = _extent(body)
    low[:2], high[:2] = np.maximum(low[:2], room.low), np.minimum(high[:2], room.high)
    if np.any(high[:2] - low[:2] < LEAST) or high[2] < LEAST or low[2] > HANGS:
        return None
    inside = [float(_extent(carried_body)[0][2]) for carried_body in carried if carried_body.relation == "contains"]
    doors = [joint for joint in body.joints if joint.type == "revolute"] or list(body.joints)
    values = [
        abs(body.joint_values.get(joint.name, 0.0)) / max(abs(joint.upper - joint.lower), 1e-6) for joint in doors
    ]
    return Furniture(
        name=body.name,
        label=body.class_name.replace("_", " "),
        centre=_point((low + high) / 2),
        size=_point(np.minimum(high - low, 4.0)),
        height=round(float(np.clip(max(inside, default=float(high[2])), 0.05, 3.0)), 3),
        door=bool(doors) and bool(inside or values and max(values) > OPENED),
        opened=bool(values) and max(values) > OPENED,
    )


def _thing(body: SceneBody, on: str) -> Thing:
    low, high = _extent(body)
    radius = float(np.clip((high - low)[:2].max() / 2, 0.01, 0.5))
    return Thing(
        name=body.name,
        label=body.class_name.replace("_", " "),
        color="",
        on=on,
        at=_point((low + high) / 2),
        radius=round(radius, 3),
    )
