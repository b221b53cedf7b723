"""Rooms of the house: four recipes, and things drawn into their places until none lies in another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import open3d as o3d
import trimesh

Where = Literal["wall", "floor", "on", "beside", "hangs"]
TRIES = 400
FLAT = 0.004
"""What a thing is put on is level: heights under its foot differ by less [m]."""
GAP = 0.06
"""Between things [m]."""
WALL = 0.1
"""Thickness of walls and floor [m]."""


@dataclass(frozen=True)
class Wish:
    """A thing that a room shall have: where, and on or beside what."""

    model: str
    where: Where
    other: str = ""


@dataclass(frozen=True)
class Recipe:
    """Least and most size (width, depth) [m] of a room, and what it shall have, in the order of placing."""

    least: tuple[float, float]
    most: tuple[float, float]
    wishes: Sequence[Wish]


def _on(other: str, *models: str) -> list[Wish]:
    return [Wish(model, "on", other) for model in models]


RECIPES: Mapping[str, Recipe] = {
    "living": Recipe(
        (5.4, 5.0),
        (6.2, 5.8),
        (
            Wish("sofa", "wall"),
            Wish("tv_cabinet", "wall"),
            Wish("shoe_rack", "wall"),
            Wish("coffee_table", "floor"),
            Wish("chair_s", "floor"),
            Wish("trash", "wall"),
            Wish("side_table", "floor"),
            *_on("tv_cabinet", "tv", "kettle_a"),
            *_on("coffee_table", "plate", "cup", "kettle_b", "pan"),
            *_on("side_table", "kettle_c", "plate"),
            Wish("clock", "hangs"),
        ),
    ),
    "kitchen": Recipe(
        (4.6, 4.4),
        (5.4, 5.2),
        (
            Wish("fridge", "wall"),
            Wish("dishwasher", "wall"),
            Wish("vention_table", "wall"),
            Wish("kitchen_table", "floor"),
            *[Wish("chair_a", "beside", "kitchen_table")] * 3,
            Wish("trash", "wall"),
            Wish("microwave", "on", "vention_table"),
            *_on("kitchen_table", "plate", "plate", "cup", "kettle_b", "pan", "kettle_a"),
            *_on("dishwasher", "kettle_c"),
            Wish("clock", "hangs"),
        ),
    ),
    "study": Recipe(
        (4.2, 4.0),
        (5.0, 4.8),
        (
            Wish("wardrobe", "wall"),
            Wish("reading_desk", "wall"),
            Wish("wood_table", "wall"),
            Wish("night_stand", "wall"),
            Wish("chair_d", "beside", "reading_desk"),
            Wish("chair_s", "beside", "wood_table"),
            Wish("crate", "floor"),
            Wish("balcony_table", "floor"),
            Wish("trash", "wall"),
            *_on("reading_desk", "cup", "kettle_a"),
            *_on("wood_table", "plate", "pan", "kettle_b"),
            *_on("night_stand", "kettle_c"),
            *_on("balcony_table", "plate", "cup"),
        ),
    ),
    "bedroom": Recipe(
        (4.8, 4.6),
        (5.6, 5.2),
        (
            Wish("bed", "wall"),
            Wish("wardrobe", "wall"),
            Wish("night_stand", "wall"),
            Wish("night_stand", "wall"),
            Wish("study_table", "wall"),
            Wish("chair_a", "beside", "study_table"),
            Wish("coffee_table", "floor"),
            Wish("trash", "wall"),
            *_on("night_stand", "kettle_a"),
            *_on("study_table", "cup", "plate"),
            *_on("coffee_table", "plate", "kettle_c", "pan", "cup", "kettle_b"),
        ),
    ),
}


@dataclass(frozen=True)
class Thing:
    """A thing where it stands: mesh in the world frame [m]; `parent`: name of what carries it."""

    name: str
    model: str
    mesh: trimesh.Trimesh
    parent: str
    hangs: bool = False

    @property
    def bounds(self) -> np.ndarray:
        """(2, 3): least and most corner [m]."""
        return np.asarray(self.mesh.bounds)


@dataclass
class House:
    """A furnished room: the floor's top is z = 0, the inside (0, 0) to `size` [m]."""

    size: np.ndarray
    """(3,): width, depth, height."""
    things: list[Thing] = field(default_factory=list)
    layout: dict[str, trimesh.Trimesh] = field(default_factory=dict)
    unplaced: list[str] = field(default_factory=list)


def furnish(recipe: Recipe, meshes: Mapping[str, trimesh.Trimesh], random: np.random.Generator) -> House:
    """Return a room with the things that found a place; `meshes`: model -> mesh in its own frame."""
    house = House(np.array([*random.uniform(recipe.least, recipe.most), 2.6]))
    house.layout = shell(house.size)
    for wish in recipe.wishes:
        for _ in range(TRIES):
            thing = _tried(house, wish, meshes[wish.model], random)
            if thing is not None:
                house.things.append(thing)
                break
        else:
            house.unplaced.append(wish.model)
    return house


def shell(size: np.ndarray) -> dict[str, trimesh.Trimesh]:
    """Return floor and four walls of a room of this inside [m]."""
    x, y, z = size
    boxes = {
        "floor": ((-WALL, -WALL, -WALL), (x + WALL, y + WALL, 0)),
        "wall_1": ((-WALL, -WALL, 0), (x + WALL, 0, z)),
        "wall_2": ((-WALL, y, 0), (x + WALL, y + WALL, z)),
        "wall_3": ((-WALL, 0, 0), (0, y, z)),
        "wall_4": ((x, 0, 0), (x + WALL, y, z)),
    }
    return {name: trimesh.creation.box(bounds=np.array(corners)) for name, corners in boxes.items()}


def _tried(house: House, wish: Wish, mesh: trimesh.Trimesh, random: np.random.Generator) -> Thing | None:
    """Draw a place; None where it is taken."""
    name = f"{wish.model}_{sum(thing.model == wish.model for thing in house.things) + 1}"
    if wish.where == "on":
        carriers = [thing for thing in house.things if thing.model == wish.other]
        return _put_on(house, carriers[random.integers(len(carriers))], name, wish, mesh, random) if carriers else None
    placed = _on_floor(house, wish, mesh, random)
    if placed is None:
        return None
    low, high = placed.bounds
    if (low[:2] < 0.005).any() or (high[:2] > house.size[:2] - 0.005).any():
        return None
    if any(_meet(placed.bounds, thing.bounds, GAP) for thing in house.things):
        return None
    hangs = wish.where == "hangs"
    return Thing(name, wish.model, placed, _wall_behind(house, placed) if hangs else "floor", hangs)


def _on_floor(house: House, wish: Wish, mesh: trimesh.Trimesh, random: np.random.Generator) -> trimesh.Trimesh | None:
    """Return the thing at a drawn place on the floor or at a wall; None where there is nothing to be beside of."""
    if wish.where == "floor":
        return placed_at(mesh, random.uniform(0, 2 * np.pi), [*random.uniform(0.5, house.size[:2] - 0.5), 0.0])
    if wish.where == "beside":
        tables = [thing for thing in house.things if thing.model == wish.other]
        if not tables:
            return None
        low, high = tables[random.integers(len(tables))].bounds[:, :2]
        side, along = random.integers(4), random.uniform(0.25, 0.75)
        axis, far = side // 2, side % 2
        point = low + along * (high - low)
        out = random.uniform(0.3, 0.5)
        point[axis] = (high[axis] + out) if far else (low[axis] - out)
        facing = np.zeros(2)
        facing[axis] = -1.0 if far else 1.0
        return placed_at(mesh, _yaw_of_front(facing) + random.normal(0, 0.15), [*point, 0.0])
    side, along = random.integers(4), random.uniform(0.1, 0.9)
    axis, far = side // 2, side % 2
    inwards = np.zeros(2)
    inwards[axis] = -1.0 if far else 1.0
    turned = placed_at(mesh, _yaw_of_front(inwards), [0, 0, random.uniform(1.4, 1.8) if wish.where == "hangs" else 0])
    low, high = turned.bounds[:, :2]
    point = along * house.size[:2]
    gap = 0.006 if wish.where == "hangs" else random.uniform(0.02, 0.06)
    point[axis] = house.size[axis] - high[axis] - gap if far else gap - low[axis]
    turned.apply_translation([*point, 0.0])
    return turned


def _put_on(
    house: House, carrier: Thing, name: str, wish: Wish, mesh: trimesh.Trimesh, random: np.random.Generator
) -> Thing | None:
    """Return the thing upon a level place of its carrier; None where there is none."""
    low, high = carrier.bounds[:, :2]
    front = carrier.bounds.mean(axis=0)[:2] - house.size[:2] / 2
    yaw = _yaw_of_front(-front) if wish.model in ("tv", "microwave") else random.uniform(0, 2 * np.pi)
    if wish.model in ("tv", "microwave"):
        yaw = np.round(yaw / (np.pi / 2)) * np.pi / 2
    placed = placed_at(mesh, yaw, [*random.uniform(low, high), 0.0])
    feet = placed.bounds[:, :2]
    corners = np.stack(np.meshgrid(*(np.linspace(a, b, 5) for a, b in feet.T)), axis=-1).reshape(-1, 2)
    heights = _heights(carrier.mesh, corners)
    if not np.isfinite(heights).all() or np.ptp(heights) > FLAT:
        return None
    placed.apply_translation((0, 0, heights.max()))
    others = [thing for thing in house.things if thing is not carrier]
    if any(_meet(placed.bounds, thing.bounds, GAP) for thing in others):
        return None
    return Thing(name, wish.model, placed, carrier.name)


def placed_at(mesh: trimesh.Trimesh, yaw: float, place: Sequence[float]) -> trimesh.Trimesh:
    """Return a copy turned by `yaw` [rad] about z and moved to `place` (3,) [m]."""
    copy = mesh.copy()
    pose = trimesh.transformations.rotation_matrix(yaw, (0, 0, 1))
    pose[:3, 3] = place
    copy.apply_transform(pose)
    return copy


def _yaw_of_front(facing: np.ndarray) -> float:
    """Return the yaw [rad] at which the front, -y of a model, points along `facing` (2,)."""
    return float(np.arctan2(facing[0], -facing[1]))


def _meet(first: np.ndarray, second: np.ndarray, gap: float) -> bool:
    """Whether boxes (2, 3) are less than `gap` [m] apart along every axis of the plan, and share some height."""
    apart = np.maximum(first[0], second[0]) - np.minimum(first[1], second[1])
    return bool((apart[:2] < gap).all() and apart[2] < -1e-4)


def _heights(mesh: trimesh.Trimesh, points: np.ndarray) -> np.ndarray:
    """Return the height (N,) [m] of a mesh's top over points (N, 2), inf where there is none."""
    top = float(mesh.bounds[1][2]) + 1.0
    rays = np.zeros((len(points), 6), np.float32)
    rays[:, :2], rays[:, 2], rays[:, 5] = points, top, -1.0
    hit = scene_of([mesh]).cast_rays(o3d.core.Tensor.from_numpy(rays))["t_hit"].numpy()
    return np.where(np.isfinite(hit), top - hit, np.inf)


def scene_of(meshes: Sequence[trimesh.Trimesh]) -> o3d.t.geometry.RaycastingScene:
    """Return meshes ready for rays, the n-th as geometry n."""
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    for mesh in meshes:
        scene.add_triangles(
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(mesh.vertices, dtype=np.float32)),
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(mesh.faces, dtype=np.uint32)),
        )
    return scene


def _wall_behind(house: House, placed: trimesh.Trimesh) -> str:
    low, high = placed.bounds[:, :2]
    distances = {
        "wall_1": low[1],
        "wall_2": house.size[1] - high[1],
        "wall_3": low[0],
        "wall_4": house.size[0] - high[0],
    }
    return min(distances, key=lambda name: float(distances[name]))
