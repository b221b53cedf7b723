"""What to look at from where: greedy coverage of the room's surface, after the looks that a room is recorded for.

Next-best-view as set cover (Scott, Roth & Rivest 2003, section 3): surface samples, candidate views, and always the
candidate that sees most of what was not seen yet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.cameras import project
from scenewright.stages.kit.geometry.transforms import apply, inverse, look_at
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.synthesize.arrangement import Arrangement, world_meshes
from scenewright.stages.synthesize.free_space import CELL, FreeSpace, find_free_space
from scenewright.stages.synthesize.placement import PlacedObject

EYE_HEIGHT = 1.5
"""Height of the camera over the floor [m]."""
CANDIDATES, SAMPLES = 260, 5000
"""Views that are tried, and points of the room that they are judged by; by eye."""
NEAR, FAR, STEEPEST = 0.6, 3.5, 0.25
"""A sample counts as seen between these depths [m] and with at least this cosine of incidence."""
LEAST_FLOOR = 3.0
"""Least free floor of a room that is walked through [m^2]."""
LAYOUT_WEIGHT = {"floor": 1.0, "wall": 0.3, "ceiling": 0.0}
"""Weight of the room's own surfaces beside that of things (1); by eye."""


@dataclass(frozen=True)
class View:
    """A place to stand, an eye height and what to look at."""

    eye: np.ndarray
    """(3,) [m]."""
    target: np.ndarray
    """(3,) [m]."""


def _nearest_floor_point(space: FreeSpace, target: np.ndarray, radius: float) -> np.ndarray | None:
    """Return the walkable floor point nearest to a wanted one (2,), or None when it is further than `radius`."""
    cells = space.cells()
    distance = np.linalg.norm(cells - target, axis=1)
    best = int(np.argmin(distance))
    return cells[best] if distance[best] <= radius else None


def required_views(arrangement: Arrangement, space: FreeSpace) -> list[View]:
    """Return the looks that must not be missing: into open furniture from the front (three angles, two heights) and
    closely at what stands in it, and on every table and desk from several sides."""
    views = []
    for thing in arrangement.objects:
        if thing.furnishing.joints:
            views += _into(thing, space)
            for item in arrangement.objects:
                if item.parent == thing.name and item.relation == "contains" and _stands_open(thing):
                    views += _closely_at(item, thing, space)
        elif thing.class_name in ("table", "desk"):
            views += _onto(thing, space)
        elif thing.relation == "hangs_from":
            views += _up_at(thing, space)
    return views


def blocked_floor(arrangement: Arrangement) -> str | None:
    """Return why nobody could work in a room, or None: the floor before every open piece of furniture, and beside
    every table, must belong to one walkable region of at least LEAST_FLOOR."""
    renderer = SceneRenderer(world_meshes(arrangement))
    space = find_free_space(renderer, arrangement.room.size)
    area = float(space.walkable.sum()) * CELL**2
    if area < LEAST_FLOOR:
        return f"only {area:.1f} m2 to walk on"
    for thing in arrangement.objects:
        if _stands_open(thing) and len(_into(thing, space)) < 3:
            return f"the floor before {thing.name} cannot be walked to"
        if thing.class_name == "table" and not _onto(thing, space):
            return f"{thing.name} cannot be walked to"
    return None


def _into(thing: PlacedObject, space: FreeSpace) -> list[View]:
    pose, size = thing.world_from_model, thing.furnishing.closed_size
    views = []
    for angle, reach, height, aim in (
        (0.0, 1.25, 1.5, 0.6),
        (0.0, 1.05, 1.15, 0.42),
        (-0.4, 1.2, 1.4, 0.55),
        (0.4, 1.2, 1.4, 0.55),
    ):
        local = np.array([reach * np.sin(angle), -size[1] / 2 - reach * np.cos(angle), 0.0])
        spot = _nearest_floor_point(space, apply(pose, local)[:2], 0.35)
        if spot is not None:
            views.append(View(np.array([*spot, height]), apply(pose, np.array([0.0, 0.0, aim * size[2]]))))
    return views


def _stands_open(thing: PlacedObject) -> bool:
    return any(value > 0 for value in thing.furnishing.joints.values())


def _closely_at(item: PlacedObject, container: PlacedObject, space: FreeSpace) -> list[View]:
    """Small things behind a door are a few dozen pixels from across the room: two looks from a step before it."""
    pose, size = container.world_from_model, container.furnishing.closed_size
    target = item.world_from_model[:3, 3] + np.array([0.0, 0.0, item.furnishing.closed_size[2] / 2])
    views = []
    for side in (-0.15, 0.15):
        spot = _nearest_floor_point(space, apply(pose, np.array([side, -size[1] / 2 - 0.65, 0.0]))[:2], 0.35)
        if spot is not None:
            views.append(View(np.array([*spot, np.clip(target[2] + 0.25, 0.8, EYE_HEIGHT)]), target))
    return views


def _up_at(thing: PlacedObject, space: FreeSpace) -> list[View]:
    """Nobody looks at the ceiling otherwise: two looks from below at what hangs from it, and where."""
    pose, size = thing.world_from_model, thing.furnishing.closed_size
    views = []
    for angle in (0.3, 2.4):
        away = pose[:2, 3] + 1.8 * np.array([np.cos(angle), np.sin(angle)])
        spot = _nearest_floor_point(space, away, 0.6)
        if spot is not None:
            views.append(View(np.array([*spot, EYE_HEIGHT - 0.2]), apply(pose, np.array([0.0, 0.0, 0.8 * size[2]]))))
    return views


def _onto(thing: PlacedObject, space: FreeSpace) -> list[View]:
    pose, size = thing.world_from_model, thing.furnishing.closed_size
    views = []
    for angle in np.arange(6) * np.pi / 3:
        reach = 0.75 + 0.5 * np.hypot(size[0] * np.cos(angle), size[1] * np.sin(angle))
        local = np.array([reach * np.cos(angle), reach * np.sin(angle), 0.0])
        spot = _nearest_floor_point(space, apply(pose, local)[:2], 0.3)
        if spot is not None:
            views.append(View(np.array([*spot, EYE_HEIGHT]), apply(pose, np.array([0.0, 0.0, size[2]]))))
    return views[:4] if len(views) <= 4 else views[:: max(1, len(views) // 4)]


def _surface_samples(
    renderer: SceneRenderer, arrangement: Arrangement, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points (SAMPLES, 3), normals and weights; every instance gets samples by the square root of its area.
    Bare walls weigh little, the ceiling nothing."""
    soup = renderer.soup
    edges = np.cross(soup.corners[:, 1] - soup.corners[:, 0], soup.corners[:, 2] - soup.corners[:, 0])
    area = 0.5 * np.linalg.norm(edges, axis=1).astype(np.float64)
    instance_area = np.bincount(soup.instance, weights=area)
    share = area / np.sqrt(instance_area[soup.instance])
    pick = random.choice(len(area), SAMPLES, p=share / share.sum())
    u, v = np.sqrt(random.random(SAMPLES)), random.random(SAMPLES)
    corners = soup.corners[pick].astype(np.float64)
    points = (
        (1 - u)[:, None] * corners[:, 0] + (u * (1 - v))[:, None] * corners[:, 1] + (u * v)[:, None] * corners[:, 2]
    )
    weight = np.ones(arrangement.first_object + len(arrangement.objects))
    for instance, layout in enumerate(arrangement.room.layouts, start=1):
        weight[instance] = LAYOUT_WEIGHT[layout.class_name]
    return points, soup.face_normals[pick].astype(np.float64), weight[soup.instance[pick]]


def _is_seen(
    renderer: SceneRenderer, camera: Camera, view: View, points: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """Return (N,) bool: which samples a view sees well."""
    world_from_camera = look_at(view.eye, view.target)
    pixels, depth = project(apply(inverse(world_from_camera), points), camera)
    with np.errstate(invalid="ignore"):
        inside = (depth > NEAR) & (depth < FAR)
        inside &= (
            (pixels[:, 0] >= 0) & (pixels[:, 0] < camera.width) & (pixels[:, 1] >= 0) & (pixels[:, 1] < camera.height)
        )
    ray = view.eye - points
    cosine = np.einsum("ij,ij->i", ray, normals) / np.linalg.norm(ray, axis=1)
    inside &= cosine > STEEPEST
    rows = np.flatnonzero(inside)
    lifted = points[rows] + 2e-3 * normals[rows]
    blocked = renderer.occluded(lifted, np.broadcast_to(view.eye, lifted.shape))
    is_visible = np.zeros(len(points), dtype=bool)
    is_visible[rows[~blocked]] = True
    return is_visible


def choose_views(
    renderer: SceneRenderer,
    arrangement: Arrangement,
    space: FreeSpace,
    camera: Camera,
    random: np.random.Generator,
    *,
    extra: int = 22,
) -> list[View]:
    """Return first the view that sees most of the room, then the required views, then up to `extra` more that see most
    of the rest."""
    points, normals, weight = _surface_samples(renderer, arrangement, random)
    required = required_views(arrangement, space)
    missing = np.ones(len(points), dtype=bool)
    for view in required:
        missing &= ~_is_seen(renderer, camera, view, points, normals)
    cells = space.cells()
    candidates = []
    for _ in range(CANDIDATES):
        eye = np.array([*cells[int(random.integers(len(cells)))], EYE_HEIGHT + random.uniform(-0.15, 0.12)])
        target = points[int(random.integers(len(points)))].copy()
        flat = np.linalg.norm(target[:2] - eye[:2])
        if flat < 0.5:
            continue
        # A sensor in the hand looks a little down, and never steeper than this.
        target[2] = np.clip(target[2], eye[2] - 1.2 * flat, eye[2] - 0.1 * flat)
        candidates.append(View(eye, target))
    visible = np.array([_is_seen(renderer, camera, view, points, normals) for view in candidates])
    overview = int(np.argmax(visible @ weight))
    missing &= ~visible[overview]
    chosen = [candidates[overview], *required]
    for _ in range(extra):
        gain = (visible & missing) @ weight
        best = int(np.argmax(gain))
        if gain[best] < 0.006 * weight.sum():
            break
        chosen.append(candidates[best])
        missing &= ~visible[best]
    return chosen
