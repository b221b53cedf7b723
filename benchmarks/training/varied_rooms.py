"""Rooms of training frames that follow no recipe: any size, anything beside anything, half from `shapes`."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import trimesh
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.synthesize import Catalogue

from benchmarks.training.clutter import Thing, height_map, primitives, put_down
from benchmarks.training.shapes import MAKERS, SMALL_MAKERS, Maker, Random, box, chair, color

LIBRARY_SHARE = 0.45
"""Of the furniture whose class the library has."""
TRIES = 6
SMALL = (
    *("bottle", "bowl", "cup", "book", "box", "keyboard", "mouse", "microwave", "vase", "plate", "pan", "can", "jug"),
    *("kettle", "cooking_pot", "clock", "remote", "tray", "toolbox", "printer", "laptop", "monitor", "lamp"),
)
HALF_TURNS = (np.array([0.0, 1.0]), np.array([-1.0, 0.0]), np.array([0.0, -1.0]), np.array([1.0, 0.0]))
"""From the middle of the room to the wall whose things are turned by 0, 90, 180 and 270 degrees."""


@dataclass
class Furnished:
    """A room being filled."""

    size: np.ndarray
    """(3,) [m]; the origin is the middle of the floor."""
    meshes: list[tuple[int, trimesh.Trimesh]] = field(default_factory=list)
    classes: dict[int, str] = field(default_factory=dict)
    boxes: list[np.ndarray] = field(default_factory=list)
    """(2, 3) bounds of what stands in it."""

    def add(self, class_name: str, mesh: trimesh.Trimesh, *, solid: bool = True) -> None:
        """Add a mesh in the world frame."""
        number = len(self.meshes) + 1
        self.meshes.append((number, mesh))
        self.classes[number] = class_name
        if solid:
            self.boxes.append(np.asarray(mesh.bounds))

    def free(self, bounds: np.ndarray, gap: float) -> bool:
        """Whether bounds (2, 3) lie in the room and meet nothing."""
        half = self.size[:2] / 2
        if np.any(bounds[0, :2] < -half - 1e-3) or np.any(bounds[1, :2] > half + 1e-3) or bounds[1, 2] > self.size[2]:
            return False
        return not any(np.all(bounds[0] < b[1] + gap) and np.all(bounds[1] > b[0] - gap) for b in self.boxes)


def varied_room(catalogue: Catalogue, random: Random) -> Furnished:
    """Return a room of 2 to 9 metres with walls, fittings, furniture, seats around tables, and things put on them."""
    room = Furnished(np.array([*np.exp(random.uniform(np.log(2.2), np.log(9.0), 2)), random.uniform(2.2, 3.4)]))
    _build_shell(room, random)
    tastes = np.exp(random.normal(0.0, 1.0, len(MAKERS))) * [maker.share for maker in MAKERS]
    area = float(room.size[0] * room.size[1])
    number = int(np.clip(random.uniform(0.3, 1.4) * area + 4, 5, 42))
    for index in random.choice(len(MAKERS), number, p=tastes / tastes.sum()):
        _place(room, MAKERS[int(index)], catalogue, random)
    _put_things(room, catalogue, random)
    return room


def _build_shell(room: Furnished, random: Random) -> None:
    x, y, z = room.size / [2, 2, 1]
    wall, t = color(random) if random.random() < 0.4 else _pale(random), 0.05
    room.add("floor", box((-x - t, x + t), (-y - t, y + t), (-t, 0), color(random)), solid=False)
    spans = (((-x, x), (y, y + t)), ((-x - t, -x), (-y - t, y + t)), ((-x, x), (-y - t, -y)), ((x, x + t), (-y, y)))
    for across, along in spans:
        paint = wall if random.random() < 0.75 else color(random)
        room.add("wall", box(across, along, (0, z), paint), solid=False)
    if random.random() < 0.8:
        room.add("ceiling", box((-x - t, x + t), (-y - t, y + t), (z, z + t), _pale(random)), solid=False)
    for _ in range(int(random.choice([0, 0, 1, 2]))):
        # A pillar, a chimney breast or a partition.
        wide, deep = random.uniform([0.2, 0.1], [1.6, 0.5])
        low = np.array([random.uniform(-x, x - wide), random.uniform(-y, y - deep)])
        if random.random() < 0.6:
            low[1] = y - deep
        room.add("wall", box((low[0], low[0] + wide), (low[1], low[1] + deep), (0, z), wall))


def _pale(random: Random) -> np.ndarray:
    return np.array([*np.clip(random.uniform(175, 250) + random.normal(0, 8, 3), 0, 255), 255]).astype(np.uint8)


def _shape(maker: Maker, catalogue: Catalogue, random: Random) -> trimesh.Trimesh:
    models = catalogue.by_class.get(maker.class_name, [])
    if maker.class_name in ("object", "box") or not models or random.random() >= LIBRARY_SHARE:
        return maker.make(random)
    model = models[int(random.integers(len(models)))]
    joints = {}
    for joint in model.joints:
        if random.random() < 0.15:
            joints[joint.name] = round(float(random.uniform(joint.lower, joint.upper)), 1)
    mesh = catalogue.furnishing(model, joints).mesh.copy()
    if maker.where == "floor" or maker.where == "wall_floor":
        mesh.apply_translation([0, 0, -mesh.bounds[0, 2]])
    return mesh


def _place(room: Furnished, maker: Maker, catalogue: Catalogue, random: Random) -> None:
    mesh = _shape(maker, catalogue, random)
    if random.random() < 0.7:
        mesh.apply_scale(random.uniform(0.85, 1.18, 3) if random.random() < 0.5 else float(random.uniform(0.85, 1.2)))
    low, high = mesh.bounds
    mesh.apply_translation([-0.5 * (low[0] + high[0]), -high[1], -low[2]])
    for _ in range(TRIES):
        side = int(random.integers(4))
        yaw = side * np.pi / 2
        if maker.where in ("floor", "ceiling") and random.random() < 0.6:
            yaw = float(random.uniform(-np.pi, np.pi))
        placed = mesh.copy()
        placed.apply_transform(transform_from_yaw(yaw, np.zeros(3)))
        extent = np.ptp(placed.bounds, axis=0)
        spare = (room.size[:2] - extent[:2]) / 2
        if np.any(spare < 0):
            continue
        target = random.uniform(-spare, spare)
        if maker.where in ("wall_floor", "wall"):
            gap = 0.0 if maker.where == "wall" else float(random.choice([0.0, random.uniform(0, 0.12)]))
            outward = HALF_TURNS[side]
            target = np.where(outward != 0, outward * np.maximum(spare - gap, 0), target)
        level = float(random.uniform(*maker.heights)) if maker.where == "wall" else 0.0
        if maker.where == "ceiling":
            level = float(room.size[2] - extent[2]) - 1e-3
        middle = 0.5 * placed.bounds.sum(axis=0)
        placed.apply_translation([*(target - middle[:2]), level])
        if not room.free(np.asarray(placed.bounds), 0.005):
            continue
        room.add(maker.class_name, placed)
        if maker.class_name in ("table", "desk") and extent[2] > 0.6 and random.random() < 0.75:
            _seat_around(room, np.asarray(placed.bounds), catalogue, random)
        return


def _seat_around(room: Furnished, table: np.ndarray, catalogue: Catalogue, random: Random) -> None:
    """Chairs, mostly of one make, that look at the table and stand partly under it."""
    models = catalogue.by_class.get("chair", [])
    if models and random.random() < LIBRARY_SHARE:
        model = catalogue.furnishing(models[int(random.integers(len(models)))], {}).mesh.copy()
    else:
        model = chair(random)
    low, high = model.bounds
    model.apply_translation([-0.5 * (low[0] + high[0]), -0.5 * (low[1] + high[1]), -low[2]])
    for _ in range(int(random.integers(1, 9))):
        side = int(random.integers(4))
        outward = HALF_TURNS[side]
        middle, half = 0.5 * table.sum(axis=0)[:2], 0.5 * np.ptp(table, axis=0)[:2]
        place = middle + np.where(
            outward != 0, outward * (half + random.uniform(-0.1, 0.35)), random.uniform(-half, half)
        )
        turned = model.copy()
        yaw = side * np.pi / 2 + float(random.normal(0.0, 0.35))
        turned.apply_transform(transform_from_yaw(yaw, np.array([*place, 0.0])))
        bounds = np.asarray(turned.bounds)
        others = [b for b in room.boxes if not np.array_equal(b, table)]
        half_room = room.size[:2] / 2
        inside = np.all(bounds[0, :2] > -half_room) and np.all(bounds[1, :2] < half_room)
        if inside and not any(np.all(bounds[0] < b[1] + 0.01) and np.all(bounds[1] > b[0] - 0.01) for b in others):
            room.add("chair", turned)


def _put_things(room: Furnished, catalogue: Catalogue, random: Random) -> None:
    """Small things and clutter on level tops and on the floor."""
    number = int(random.choice([0, int(random.integers(3, 15)), int(random.integers(12, 45))], p=[0.1, 0.5, 0.4]))
    if not number:
        return
    half = room.size[:2] / 2
    heights = height_map(SceneRenderer(room.meshes), -half + 0.05, half - 0.05, room.size[2] - 0.1, 0.02)
    raised = np.argwhere((heights.height > 0.2) & (heights.height < 1.7))
    models = [model for name in SMALL for model in catalogue.by_class.get(name, [])]
    shapes = primitives(random, scale=float(random.uniform(0.7, 1.4)))
    for _ in range(number):
        kind = random.random()
        if kind < 0.45 and models:
            model = models[int(random.integers(len(models)))]
            mesh = catalogue.furnishing(model, {}).mesh.copy()
            mesh.apply_scale(float(random.uniform(0.85, 1.2)))
            thing = Thing(model.class_name, mesh, model.class_name in ("box", "book", "microwave"))
        elif kind < 0.75:
            thing = next(shapes)
        else:
            maker = SMALL_MAKERS[int(random.integers(len(SMALL_MAKERS)))]
            mesh = maker.make(random)
            largest = float(np.ptp(mesh.bounds, axis=0).max())
            mesh.apply_scale(min(1.0, float(random.uniform(0.1, 0.6)) / largest))
            thing = Thing(maker.class_name, mesh, False)
        thing.mesh.apply_translation([0, 0, -thing.mesh.bounds[0, 2]])
        low, high = -half, half
        if len(raised) and random.random() < 0.85:
            place = heights.origin + heights.cell * raised[int(random.integers(len(raised)))]
            low, high = place - 0.06, place + 0.06
        put = put_down(thing, heights, low, high, random)
        if put is not None:
            room.add(thing.class_name, put, solid=False)
