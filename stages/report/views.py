"""Views into a room from outside: near walls and the ceiling are cut away, the side that shows most is chosen."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.transforms import look_at
from scenewright.stages.kit.rendering.ray_casting import Rendering, SceneRenderer
from scenewright.stages.kit.rendering.surfaces import TriangleSoup
from scenewright.stages.report.surfaces import Model

FIELD_OF_VIEW = np.radians(32.0)
"""Opening angle of the views [rad]; by eye."""
PLAN_FIELD_OF_VIEW = np.radians(8.0)
"""Opening angle of the plan from above [rad]: almost parallel rays, so that walls stay lines."""
ELEVATION = np.radians(42.0)
"""Angle of the views over the horizontal [rad]; by eye."""
AZIMUTHS = 12
"""Directions around a scene that are tried for its view; by eye."""
SHELL = 0.25
"""Triangles this near to the bounds that look outward belong to the outside of the room [m]."""


@dataclass(frozen=True)
class Bounds:
    """What a view shows."""

    low: np.ndarray
    high: np.ndarray

    @property
    def center(self) -> np.ndarray:
        """(3,) centre."""
        return (self.low + self.high) / 2.0

    def corners(self) -> np.ndarray:
        """(8, 3)."""
        return np.array(
            [
                [x, y, z]
                for x in (self.low[0], self.high[0])
                for y in (self.low[1], self.high[1])
                for z in (self.low[2], self.high[2])
            ]
        )


@dataclass(frozen=True)
class View:
    """A camera pose and which way it was chosen."""

    camera: Camera
    world_from_camera: np.ndarray


def bounds_of(model: Model, highest: float = 2.2) -> Bounds:
    """Bounds without outliers: the 0.5 and 99.5 percent quantiles of triangle centres, not above `highest` [m]
    over the lowest."""
    centers = model.centers[~model.ceiling] if not model.ceiling.all() else model.centers
    low, high = np.quantile(centers, [0.005, 0.995], axis=0)
    high[2] = min(high[2], low[2] + highest)
    return Bounds(low.astype(float), np.maximum(high, low + 0.1).astype(float))


def page_camera(width: int, height: int, field_of_view: float = FIELD_OF_VIEW) -> Camera:
    """A camera with a field of view [rad] over its width."""
    focal = width / (2.0 * np.tan(field_of_view / 2.0))
    return Camera(width=width, height=height, fx=focal, fy=focal, cx=(width - 1) / 2, cy=(height - 1) / 2)


def fitted_pose(
    camera: Camera, bounds: Bounds, direction: np.ndarray, up: tuple[float, float, float] = (0.0, 0.0, 1.0)
) -> np.ndarray:
    """world_from_camera that looks along -`direction` at the bounds, as near as they fit, centred in the picture."""
    direction = direction / np.linalg.norm(direction)
    corners = bounds.corners()
    target = bounds.center
    distance = 1.0
    for _ in range(40):
        pose = look_at(target + distance * direction, target, np.array(up))
        local = (corners - pose[:3, 3]) @ pose[:3, :3]
        if local[:, 2].min() < 0.1:
            distance *= 1.3
            continue
        u, v = local[:, 0] / local[:, 2], local[:, 1] / local[:, 2]
        # Move the aim so that the box sits in the middle, then the distance so that it fills the picture.
        shift = pose[:3, 0] * (u.min() + u.max()) / 2 + pose[:3, 1] * (v.min() + v.max()) / 2
        target = target + distance * shift
        fill = max((u.max() - u.min()) * camera.fx / camera.width, (v.max() - v.min()) * camera.fy / camera.height)
        distance *= float(np.clip(fill / 0.94, 0.5, 2.0))
    return look_at(target + distance * direction, target, np.array(up))


def cut_away(model: Model, eye: np.ndarray, bounds: Bounds) -> TriangleSoup:
    """Return the soup without what hides the inside from `eye`: ceilings, and walls and unlabelled surface that turn
    their back to the eye or are the outside of the room."""
    centers, normals = model.centers, model.soup.face_normals * model.inward_sign(bounds.center)
    away = np.einsum("ij,ij->i", normals, centers - eye) > 0
    outward = np.einsum("ij,ij->i", normals, bounds.center - centers) < 0
    sides = np.minimum(np.abs(centers[:, :2] - bounds.low[:2]), np.abs(centers[:, :2] - bounds.high[:2])).min(axis=1)
    outside = np.any((centers[:, :2] < bounds.low[:2]) | (centers[:, :2] > bounds.high[:2]), axis=1)
    shell = outward & ((sides < SHELL) | outside | (centers[:, 2] > bounds.high[2] - SHELL))
    floor = (normals[:, 2] > 0.8) & (centers[:, 2] < bounds.low[2] + SHELL)
    keep = (model.solid | floor | ~(away | shell)) & ~model.ceiling
    if not keep.any():
        return model.soup
    arrays = {f.name: getattr(model.soup, f.name)[keep] for f in fields(model.soup) if f.name != "material_table"}
    return replace(model.soup, **arrays)


def direction_of(azimuth: float, elevation: float = ELEVATION) -> np.ndarray:
    """Unit vector (3,) from the room towards the eye."""
    return np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])


def best_azimuth(model: Model) -> float:
    """Return the azimuth [rad], of twelve, towards which the things' surfaces face most.

    Each thing counts with the square root of its area that faces the eye, so that many small things outweigh one
    large one; occlusion is not considered.
    """
    is_thing = model.things
    if not is_thing.any():
        return 2.0 * np.pi * 0.5 / AZIMUTHS
    corners = model.soup.corners[is_thing]
    area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    _, owner = np.unique(model.soup.instance[is_thing], return_inverse=True)
    sign = model.inward_sign(model.centers.mean(axis=0))
    azimuths = 2.0 * np.pi * (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS
    scores = [
        np.sqrt(np.bincount(owner, weights=np.maximum(sign * (area @ direction_of(a)), 0.0))).sum() for a in azimuths
    ]
    return float(azimuths[int(np.argmax(np.round(scores, 9)))])


def oblique_view(model: Model, width: int, height: int) -> View:
    """The oblique view of the whole room from its best side."""
    camera = page_camera(width, height)
    return View(camera, fitted_pose(camera, bounds_of(model), direction_of(best_azimuth(model))))


def top_view(model: Model, width: int) -> View:
    """Straight down, y up; the picture's height follows the room's shape."""
    bounds = bounds_of(model)
    extent = bounds.high - bounds.low
    height = int(np.clip(width * (extent[1] + 0.3) / (extent[0] + 0.3), 0.45 * width, 1.1 * width))
    camera = page_camera(width, height, PLAN_FIELD_OF_VIEW)
    return View(camera, fitted_pose(camera, bounds, np.array([0.0, 0.0, 1.0]), up=(0.0, 1.0, 0.0)))


def render(model: Model, view: View) -> Rendering:
    """Render a model with the near side of the room cut away."""
    soup = cut_away(model, view.world_from_camera[:3, 3], bounds_of(model))
    return SceneRenderer(soup).render(view.camera, view.world_from_camera)


@dataclass(frozen=True)
class Label:
    """A name on a picture, in pixels."""

    x: int
    y: int
    text: str
    title: str


def place_labels(
    instance: np.ndarray, names: dict[int, str], font_size: float = 13.0, minimum_pixels: int = 120
) -> list[Label]:
    """Put names on (H, W) instance images: in the middle of what is seen, large things first, none over another."""
    values, counts = np.unique(instance, return_counts=True)
    used_boxes: list[tuple[float, float, float, float]] = []
    labels: list[Label] = []
    for value, count in sorted(zip(values.tolist(), counts.tolist(), strict=True), key=lambda vc: (-vc[1], vc[0])):
        if value not in names or count < minimum_pixels:
            continue
        rows, columns = np.nonzero(instance == value)
        nearest = int(np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2))
        x, y = int(columns[nearest]), int(rows[nearest])
        half, high = 0.28 * font_size * len(names[value]) + 4, 0.68 * font_size
        x = int(np.clip(x, half, instance.shape[1] - half)) if instance.shape[1] > 2 * half else x
        box = (x - half, y - high, x + half, y + high)
        if any(box[0] < b[2] and b[0] < box[2] and box[1] < b[3] and b[1] < box[3] for b in used_boxes):
            continue
        used_boxes.append(box)
        labels.append(Label(x, y, names[value], f"{names[value]}: {count} pixels in this view"))
    return labels
