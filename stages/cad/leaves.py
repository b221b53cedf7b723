"""The leaf of a joint: the face of its part that is looked at when it is closed, and what the map shows there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.cad.model_surfaces import ModelSurface
from scenewright.stages.kit.formats.cad_models import part_transforms
from scenewright.stages.kit.geometry.transforms import apply

OUTERMOST = 0.08
"""A leaf lies at most this far behind what of the model reaches out farthest on its side (handles) [m]; what lies
deeper is behind something."""
FACES = 0.8
"""Cosine within which surface faces a leaf's way."""
LEVEL_BIN = 0.01
"""Heights of faces are counted in steps of this [m]."""
LEAST_FACE = 0.3
"""A face of a part has this share of its largest face's area; the outermost of them is the leaf."""
BEFORE, BEHIND = 0.12, 0.08
"""How far before and behind a leaf the map is looked at [m]."""
RIM, BESIDE = 0.01, 0.07
"""How far beside a leaf surface is still of it, and how far its neighbourhood goes, where seams are looked for [m]."""
FLATNESS = 0.012
"""Farther from the plane of the front is not of it [m]."""
FEWEST = 30
"""Vertices without which nothing can be said."""


@dataclass(frozen=True)
class Leaf:
    """A rectangle in the closed model's frame, scaled [m]."""

    joint: Joint
    axis: int
    """Axis of the model frame that it faces along."""
    sign: float
    """Which way."""
    level: float
    """Height of the face along that direction [m]."""
    low: np.ndarray
    """(2,) least corner along the two other axes, in their order [m]."""
    size: np.ndarray
    """(2,) [m]."""
    body_low: np.ndarray
    """(2,) least corner of the whole model's outline on that side [m]."""
    body_size: np.ndarray
    """(2,) [m]."""
    scale: float

    @property
    def others(self) -> list[int]:
        """The axes in the leaf's plane."""
        return [k for k in range(3) if k != self.axis]


@dataclass(frozen=True)
class Seen:
    """What the map shows on a leaf and around it."""

    places: np.ndarray
    """(N, 2) from the leaf's least corner, along its axes [m]."""
    heights: np.ndarray
    """(N,) over the plane of the front, outwards [m]."""
    within: np.ndarray
    """(N,) bool: on the leaf, not beside it."""
    front: np.ndarray
    """(N,) bool: lies on that plane and faces its way."""
    flat: float
    """Share of the surface facing outwards that lies on it."""
    noise: float
    """Robust standard deviation of the heights of the front [m]."""
    colors: np.ndarray
    """(N, 3) float, sRGB 0 to 255."""


def leaf_of(surface: ModelSurface, joint: Joint, scale: float) -> Leaf | None:
    """Return the leaf of a joint of a model under uniform scaling, None where its part lies behind something."""
    poses = part_transforms(surface.model, {})
    corners = {part: scale * apply(poses[part], surface.corners[part]) for part in surface.model.parts}
    all_corners = np.concatenate(list(corners.values()))
    low, high = all_corners.min(axis=0), all_corners.max(axis=0)
    own_low, own_high = corners[joint.part].min(axis=0), corners[joint.part].max(axis=0)
    axis, sign = _opening_side(joint, scale, own_low, own_high)
    vertices, triangles = surface.meshes[joint.part]
    faces = scale * apply(poses[joint.part], vertices)[triangles]
    cross = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    area = 0.5 * np.linalg.norm(cross, axis=1)
    facing = sign * cross[:, axis] > 2 * FACES * area
    if not facing.any():
        return None
    heights = sign * faces[facing].mean(axis=1)[:, axis]
    levels, number = np.unique(np.round(heights / LEVEL_BIN).astype(int), return_inverse=True)
    areas = np.bincount(number, area[facing])
    chosen = int(np.flatnonzero(areas >= LEAST_FACE * areas.max())[-1])
    level = float(np.average(heights[number == chosen], weights=area[facing][number == chosen]))
    outermost = high[axis] if sign > 0 else -low[axis]
    if outermost - level > OUTERMOST:
        return None
    others = [k for k in range(3) if k != axis]
    return Leaf(
        joint=joint,
        axis=axis,
        sign=sign,
        level=level,
        low=own_low[others],
        size=(own_high - own_low)[others],
        body_low=low[others],
        body_size=(high - low)[others],
        scale=scale,
    )


def _opening_side(joint: Joint, scale: float, low: np.ndarray, high: np.ndarray) -> tuple[int, float]:
    """Return axis and sign of the side on which a part is taken hold of: that of its handle, else that to which it
    slides, else the front. `low`, `high` (3,): its bounds, closed [m]."""
    if joint.type == "prismatic":
        axis = int(np.argmax(np.abs(joint.axis)))
        return axis, float(np.sign(joint.axis[axis]))
    if joint.handle is None:
        return 1, -1.0
    handle = scale * np.asarray(joint.handle)
    gaps = np.concatenate([handle - low, high - handle])
    gaps[[k for k in (0, 1, 2, 3, 4, 5) if abs(joint.axis[k % 3]) > FACES]] = np.inf
    best = int(np.argmin(gaps))
    return best % 3, -1.0 if best < 3 else 1.0


def seen_on(leaf: Leaf, points: np.ndarray, normals: np.ndarray, colors: np.ndarray) -> Seen | None:
    """Return what the map shows on a leaf, None where that is too little or no plane.

    `points` (N, 3) [m] and unit `normals` (N, 3) in the model's frame, scaled; `colors` (N, 3).
    """
    places = points[:, leaf.others] - leaf.low
    heights = leaf.sign * points[:, leaf.axis] - leaf.level
    at_leaf = (
        np.all((places > -BESIDE) & (places < leaf.size + BESIDE), axis=1) & (heights > -BEHIND) & (heights < BEFORE)
    )
    places, heights = places[at_leaf], heights[at_leaf]
    within = np.all((places > -RIM) & (places < leaf.size + RIM), axis=1)
    outward = within & (leaf.sign * normals[at_leaf][:, leaf.axis] > FACES)
    if np.count_nonzero(outward) < FEWEST:
        return None
    levels, counts = np.unique(np.round(heights[outward] / LEVEL_BIN).astype(int), return_counts=True)
    front = outward & (np.abs(heights - levels[np.argmax(counts)] * LEVEL_BIN) < 2 * FLATNESS)
    design = np.column_stack([places, np.ones(len(places))])
    for _ in range(3):
        if np.count_nonzero(front) < FEWEST:
            return None
        plane = np.linalg.lstsq(design[front], heights[front], rcond=None)[0]
        over = heights - design @ plane
        front = outward & (np.abs(over) < FLATNESS)
    return Seen(
        places=places,
        heights=over,
        within=within,
        front=front,
        flat=float(np.count_nonzero(front) / np.count_nonzero(outward)),
        noise=float(1.4826 * np.median(np.abs(over[front]))),
        colors=colors[at_leaf].astype(float),
    )
