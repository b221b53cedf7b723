"""A walk through a furnished room at head height: the log, its true masks, and which surface was seen.

The depth camera is the one of Barron & Malik 2013 ("Intrinsic scene properties from a single RGB-D image", section 7):
pixels jump by a normal of half a pixel, and depth is quantised in disparity after a normal of 1/6 level,
Z = 35130 / floor(35130 / Z(x + n_s) + n_d + 1/2) in centimetres. Depth is lost at grazing incidence, and at random
beside edges.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import look_at
from scenewright.stages.synthesize import SeenSurface
from scipy.ndimage import distance_transform_edt, label
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from benchmarks.experiments.house.furnishing import House
from benchmarks.experiments.house.models import MODELS
from benchmarks.experiments.house.tiny_renderer import TinyRenderer

EYE = 1.6
"""Height of the camera [m]."""
NEAREST, FARTHEST = 0.4, 4.0
"""Depth between these is measured [m]."""
BODY = 0.3
"""A walker keeps so far from things [m]."""
CELL = 0.05
STOPS = 7
TURNS = 5
"""How often the walker looks around on the way."""
DISPARITY = 351.30
"""Disparity levels times metres: 35130 in centimetres."""
GRAZING = np.cos(np.radians(84.0))
EDGE_LOSS = 0.5
"""Share of the pixels beside a step in depth that are lost."""
LEVEL = 0.95


@dataclass(frozen=True)
class Recording:
    """What was seen: `points` (N, 3) of true surface, one a centimetre cell, with `instance` (N,); `level` (M, 3):
    those seen with valid depth from above on level tops in three frames and more, with `level_instance` (M,)."""

    log: Path
    masks: Path
    names: tuple[str, ...]
    """Name of the thing or layout piece of instance 1, 2, ..."""
    points: np.ndarray
    instance: np.ndarray
    level: np.ndarray
    level_instance: np.ndarray


def class_of(name: str) -> str:
    """Return the class of a thing or a layout piece."""
    model = name.rsplit("_", 1)[0]
    return MODELS[model].class_name if model in MODELS else model


def walk(house: House, frames: int, random: np.random.Generator) -> list[np.ndarray]:
    """Return poses world_from_camera (4, 4): a round through the places where a walker has room, looking around and
    down."""
    places = free_places(house)
    stops = [int(random.integers(len(places)))]
    while len(stops) < STOPS:  # each the farthest from those before
        apart = np.min([np.linalg.norm(places - places[stop], axis=1) for stop in stops], axis=0)
        stops.append(int(np.argmax(apart)))
    path = places[round_trip(places, stops)]
    lengths = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = np.linspace(0, lengths[-1], frames, endpoint=False)
    poses = []
    for k in range(frames):
        eye = np.array([*(np.interp(at[k], lengths, path[:, axis]) for axis in (0, 1)), EYE + random.normal(0, 0.015)])
        heading = 2 * np.pi * TURNS * k / frames
        tilt = np.radians(30 + 14 * np.sin(2 * np.pi * 7 * k / frames))
        ahead = np.array([np.cos(heading) * np.cos(tilt), np.sin(heading) * np.cos(tilt), -np.sin(tilt)])
        poses.append(look_at(eye, eye + ahead))
    return poses


def free_places(house: House) -> np.ndarray:
    """Return the places (N, 2) [m] on a grid that are BODY away from walls and things, the largest connected part."""
    cells = np.ceil(house.size[:2] / CELL).astype(int)
    x, y = ((np.arange(n) + 0.5) * CELL for n in cells)
    free = np.ones(cells, bool)
    free[[0, -1]] = free[:, [0, -1]] = False
    for thing in house.things:
        if thing.parent == "floor":
            (x_low, y_low, _), (x_high, y_high, _) = thing.bounds
            free &= ~((x[:, None] > x_low) & (x[:, None] < x_high) & (y > y_low) & (y < y_high))
    parts, _ = label(distance_transform_edt(free) * CELL > BODY)
    largest = np.argmax(np.bincount(parts.ravel())[1:]) + 1
    return (np.argwhere(parts == largest) + 0.5) * CELL


def round_trip(places: np.ndarray, stops: list[int]) -> np.ndarray:
    """Return numbers of places (M,) of a way from stop to nearest stop and back to the first, from cell to cell."""
    close = cKDTree(places).sparse_distance_matrix(cKDTree(places), 1.5 * CELL, output_type="coo_matrix")
    lengths, before = dijkstra(close.tocsr(), indices=stops, return_predecessors=True)
    left, here, way = set(range(1, len(stops))), 0, [stops[0]]
    while left or here:
        following = min(left, key=lambda k: lengths[here, stops[k]]) if left else 0
        left.discard(following)
        back, place = [], stops[following]
        while place != stops[here]:
            back.append(place)
            place = int(before[here, place])
        way += back[::-1]
        here = following
    return np.array(way)


def record(house: House, folder: Path, camera: Camera, frames: int, random: np.random.Generator) -> Recording:
    """Write log and masks of a walk into `folder` and return what was seen."""
    log, masks = folder / "log", folder / "true_masks"
    for place in (log / "color", log / "depth", masks):
        place.mkdir(parents=True, exist_ok=True)
    meshes = {**house.layout, **{thing.name: thing.mesh for thing in house.things}}
    names = tuple(meshes)
    colors = random.uniform(0.2, 0.9, (len(names), 3))
    seen, level = SeenSurface(NEAREST, FARTHEST), _LevelTops()
    rows: list[str] = []
    with TinyRenderer(list(meshes.values()), colors) as renderer:
        for pose in walk(house, frames, random):
            color, exact, mesh = renderer.render(camera, pose)
            depth = disturbed(exact, camera, random)
            if not depth.any():
                continue  # `ingest` drops a frame that is too close to see anything, and masks go by its numbers.
            instance = np.where(exact > 0, mesh + 1, 0).astype(np.int32)
            seen.add(exact, instance, pose, camera)
            level.add(exact, depth, instance, pose, camera)
            stamp = f"{len(rows):06d}"
            _write_frame(log, masks, stamp, (color, depth, instance), names)
            rows.append(f"{stamp} " + " ".join(f"{value:.9g}" for value in pose.ravel()))
    (log / "poses.txt").write_text("\n".join(rows) + "\n", encoding="ascii")
    given = {name: getattr(camera, name) for name in ("fx", "fy", "cx", "cy", "width", "height")}
    (log / "camera.json").write_text(json.dumps(given), encoding="utf-8")
    points, instances = seen.result()
    return Recording(log, masks, names, points, instances, *level.result())


def disturbed(exact: np.ndarray, camera: Camera, random: np.random.Generator) -> np.ndarray:
    """Return the depth (H, W) float32 [m] that the camera reports of the true depth, 0 where it reports none."""
    height, width = exact.shape
    jump = random.normal(0, 0.5, (2, height, width))
    rows, columns = np.indices(exact.shape, dtype=np.float32)
    there = cv2.remap(
        exact, (columns + jump[0]).astype(np.float32), (rows + jump[1]).astype(np.float32), cv2.INTER_NEAREST
    )
    level = np.floor(DISPARITY / np.maximum(there, 0.05) + random.normal(0, 1 / 6, exact.shape) + 0.5)
    depth = DISPARITY / np.maximum(level, 1)
    low, high = cv2.erode(exact, np.ones((5, 5))), cv2.dilate(exact, np.ones((5, 5)))
    beside_edge = high - low > 0.05 + 0.05 * exact
    lost = (beside_edge & (random.random(exact.shape) < EDGE_LOSS)) | (incidence(exact, camera) < GRAZING)
    lost |= (there <= 0) | (depth < NEAREST) | (depth > FARTHEST)
    return np.where(lost, 0, depth).astype(np.float32)


def normals_of(depth: np.ndarray, camera: Camera) -> np.ndarray:
    """Return normals (H, W, 3) in the camera frame towards the camera, of a depth image [m]."""
    points = back_project(depth, camera)
    normals = np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0))
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    normals *= -np.sign(np.einsum("ijk,ijk->ij", normals, points))[..., None]
    return normals


def incidence(depth: np.ndarray, camera: Camera) -> np.ndarray:
    """Return the cosine (H, W) between ray and normal."""
    points = back_project(depth, camera)
    rays = points / np.maximum(np.linalg.norm(points, axis=-1, keepdims=True), 1e-12)
    cosine: np.ndarray = np.abs(np.einsum("ijk,ijk->ij", normals_of(depth, camera), rays))
    return cosine


class _LevelTops:
    """Collects level surface that was seen from above with valid depth, one point a centimetre cell."""

    LEAST_FRAMES = 3

    def __init__(self) -> None:
        self._rows: list[np.ndarray] = []

    def add(self, exact: np.ndarray, depth: np.ndarray, instance: np.ndarray, pose: np.ndarray, camera: Camera) -> None:
        upward = np.abs(normals_of(exact, camera) @ pose[2, :3]) >= LEVEL
        # Beside an edge the normal is that of the step.
        upward = cv2.erode(upward.astype(np.uint8), np.ones((3, 3))) > 0
        its_own = np.abs(depth - exact) <= 0.05 + 0.02 * exact**2
        chosen = upward & (depth > 0) & its_own & (instance > 0)
        points = back_project(exact, camera)[chosen] @ pose[:3, :3].T + pose[:3, 3]
        cells = np.concatenate([np.floor(points * 100).astype(np.int64), instance[chosen][:, None]], axis=1)
        _, first = np.unique(cells, axis=0, return_index=True)
        self._rows.append(np.concatenate([cells[first], points[first]], axis=1))

    def result(self) -> tuple[np.ndarray, np.ndarray]:
        """Return points (M, 3) float32 and instances (M,)."""
        rows = np.concatenate(self._rows)
        cells = rows[:, :4].astype(np.int64)
        _, first, count = np.unique(cells, axis=0, return_index=True, return_counts=True)
        kept = first[count >= self.LEAST_FRAMES]
        return rows[kept, 4:].astype(np.float32), cells[kept, 3]


def _write_frame(
    log: Path, masks: Path, name: str, images: tuple[np.ndarray, np.ndarray, np.ndarray], names: tuple[str, ...]
) -> None:
    color, depth, instance = images
    cv2.imwrite(str(log / "color" / f"{name}.png"), color[..., ::-1])
    cv2.imwrite(str(log / "depth" / f"{name}.png"), np.rint(1000 * depth).astype(np.uint16))
    cv2.imwrite(str(masks / f"{name}.png"), instance.astype(np.uint16))
    classes = {str(k): class_of(names[k - 1]) for k in np.unique(instance).tolist() if k}
    (masks / f"{name}.json").write_text(json.dumps(classes), encoding="utf-8")
