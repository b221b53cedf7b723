"""What speaks for a plane being a floor, a wall or a ceiling, and what against: log odds, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scenewright.stages.fuse.free_space import FreeSpace
from scenewright.stages.fuse.ground_index import GroundIndex
from scenewright.stages.fuse.layout.planes import BAND, CELL, Plane
from scipy import ndimage

BEHIND = (0.16, 0.24, 0.32, 0.4, 0.5, 0.6)
"""Distances behind a plane at which free space is looked for [m]: nearer cells hold the surface itself."""
FAR_BEHIND, BEHIND_DOOR = 2.5, 1.0
"""Surface this far behind a plane is of another room [m]; of one with a doorway, through which it is seen."""
NARROWEST = 3
"""Fewest cells of a doorway in width and height."""
THIN = 0.35
"""What is thinner than this, and was seen from both sides, is one wall [m]."""
OVER, DEEP = 2, 1.0
"""Surface that faces as a plane does, so many cells over its top and at most so far behind it [m], goes on where it
ends."""
PARALLEL = float(np.cos(np.radians(15)))
"""Cosine of normals over which two planes face the same way."""
LARGE = 1.0
"""Area of a plane that speaks neither for a bound of the room nor against [m^2]."""
VOTES = 1.5
"""Most that masks can say about a plane: log odds."""
FAINT = 0.1
"""Weight of votes under which masks say nothing: a score a look."""


@dataclass(frozen=True)
class Scene:
    """What layout is found in. All arrays are over the vertices (V,)."""

    vertices: np.ndarray
    """(V, 3) [m], world frame, z up."""
    normals: np.ndarray
    areas: np.ndarray
    """[m^2]"""
    bounding: np.ndarray
    """Mean score of masks that said floor, wall or ceiling, 0..1 a look."""
    furniture: np.ndarray
    """Mean score of masks that said anything else."""
    cameras: np.ndarray
    """(F, 3) [m]; empty of a scan."""
    free: FreeSpace | None
    """None of a scan."""

    @cached_property
    def usually_bounding(self) -> float:
        """Log odds of a bound by what masks said of the whole surface."""
        return _called_bound(self, np.arange(len(self.vertices)))

    @cached_property
    def _index(self) -> GroundIndex:
        return GroundIndex(self.vertices)

    def around(self, plane: Plane, reach: float) -> np.ndarray:
        """Return the numbers of all vertices before or behind what there is of a plane and the cells beside it, up to
        `reach` [m] away, and of some more; each once."""
        points = self.vertices[plane.members]
        margin = 2 * CELL + BAND + reach * np.abs(plane.normal)
        return self._index.around(points.min(axis=0) - margin, points.max(axis=0) + margin)


def share_behind(plane: Plane, scene: Scene) -> tuple[float, float, float]:
    """Return the shares of a plane's cells behind which free space was seen, and surface, and that are thin.

    Of what is thin and was seen from both sides only the inside is asked. Beside a doorway free space says nothing.
    """
    cells = np.unique(plane.cells(scene.vertices[plane.members]), axis=0)
    around = scene.around(plane, FAR_BEHIND)
    vertices = scene.vertices[around]
    distance = plane.distance(vertices)
    is_other_side = (distance < -0.03) & (distance > -THIN) & (scene.normals[around] @ plane.normal < -0.7)
    other_side = np.flatnonzero(is_other_side)
    thickness = np.full(len(cells), np.inf)
    own, back = _keys(cells), _keys(plane.cells(vertices[other_side]))
    order = np.argsort(own)
    place = np.minimum(np.searchsorted(own[order], back), len(own) - 1)
    is_own = own[order][place] == back
    np.minimum.at(thickness, order[place[is_own]], -distance[other_side[is_own]])
    free = np.zeros(len(cells), bool)
    if scene.free is not None:
        for depth in BEHIND:
            free |= scene.free.is_free(plane.at(cells, -depth)) & (depth < thickness)
    away = distance_to_doorway(plane, cells, scene)
    far = FAR_BEHIND if np.isinf(away).all() else BEHIND_DOOR
    beyond = np.flatnonzero((distance < -0.1) & (distance > -far))
    hidden = np.isin(own, np.unique(_keys(plane.cells(vertices[beyond])))) & ~np.isfinite(thickness)
    asked = away > BEHIND[-1]
    thin = float(np.isfinite(thickness).mean())
    return float(free[asked].mean()) if asked.any() else 0.0, float(hidden.mean()), thin


def share_overtopped(plane: Plane, scene: Scene) -> float:
    """Return the share of an upright plane's columns over the top of which surface behind it was seen, facing as it
    does: a wall ends at a ceiling or out of sight, furniture under the wall behind it."""
    cells = plane.cells(scene.vertices[plane.members])
    columns, column_of = np.unique(cells[:, 0], return_inverse=True)
    top = np.full(len(columns), np.iinfo(np.int64).min)
    np.maximum.at(top, column_of, cells[:, 1])
    around = scene.around(plane, DEEP)
    distance = plane.distance(scene.vertices[around])
    is_behind = (distance < -BAND) & (distance > -DEEP) & (scene.normals[around] @ plane.normal > PARALLEL)
    over = plane.cells(scene.vertices[around[is_behind]])
    place = np.minimum(np.searchsorted(columns, over[:, 0]), len(columns) - 1)
    is_over = (columns[place] == over[:, 0]) & (over[:, 1] >= top[place] + OVER)
    return len(np.unique(place[is_over])) / len(columns)


def distance_to_doorway(plane: Plane, cells: np.ndarray, scene: Scene) -> np.ndarray:
    """Return how far cells (N, 2) of an upright plane are from the next hole [m], infinite without one.

    A hole has surface of the plane over it and on both sides, and cameras looked far through it: a shelf has none.
    """
    nowhere = np.full(len(cells), np.inf)
    if scene.free is None or plane.is_level:
        return nowhere
    low = cells.min(axis=0)
    surface = np.zeros(cells.max(axis=0) - low + 1, bool)
    surface[tuple((cells - low).T)] = True
    sides = np.logical_or.accumulate(surface, axis=0) & np.logical_or.accumulate(surface[::-1], axis=0)[::-1]
    over = np.logical_or.accumulate(surface[:, ::-1], axis=1)[:, ::-1]
    enclosed = np.argwhere(~surface & sides & over)
    hole = np.zeros_like(surface)
    hole[tuple(enclosed[scene.free.is_free(plane.at(enclosed + low, -BEHIND[-1]))].T)] = True
    hole = ndimage.binary_opening(hole, np.ones((NARROWEST, NARROWEST), bool))
    if not hole.any():
        return nowhere
    return np.asarray(ndimage.distance_transform_edt(~hole)[tuple((cells - low).T)] * CELL)


def evidence(plane: Plane, scene: Scene, floor: float, top: float) -> dict[str, float]:
    """Return the log odds that each reason gives for a plane bounding the room.

    floor, top [m]: heights of the floor and of the highest surface.
    """
    points, weight = scene.vertices[plane.members], scene.areas[plane.members]
    free, hidden, thin = share_behind(plane, scene)
    reasons = {
        "area": float(np.clip(np.log(weight.sum() / LARGE), -1.5, 1.5)),
        "free space behind": 2.0 - 25.0 * free if scene.free is not None else 0.0,
        "surface behind": 1.0 - 6.0 * hidden,
        "masks": votes(plane, scene),
    }
    reasons["free space behind"] = max(reasons["free space behind"], -4.0)
    reasons["surface behind"] = max(reasons["surface behind"], -3.0)
    if plane.is_level:
        height = plane.offset * plane.normal[2]
        eyes = np.median(scene.cameras[:, 2]) - height if len(scene.cameras) else np.nan
        if plane.normal[2] > 0 and np.isfinite(eyes):
            reasons["height of the cameras"] = 1.5 if 0.9 <= eyes <= 2.6 else -2.0
        if plane.normal[2] < 0:
            reasons["height"] = 1.0 if height > floor + 2.0 else -6.0
    else:
        reach = float(np.quantile(points[:, 2], 0.98))
        reasons["wall over it"] = -4.0 * share_overtopped(plane, scene)
        reasons["height"] = 1.0 if reach > top - 0.3 else -2.5 if reach < floor + 1.2 else 0.0
        if thin > 0.5 and reach <= top - 0.3:  # a leaf, a screen: a partition goes up
            reasons["height"] = -4.0
        if len(scene.cameras):
            reasons["cameras"] = -2.0 if (plane.distance(scene.cameras) > 0).mean() < 0.3 else 0.0
    return reasons


def votes(plane: Plane, scene: Scene) -> float:
    """Return the log odds that masks give: by how much more they call the plane a bound than the whole surface.

    Masks that call everything a wall say nothing of any plane.
    """
    own = _called_bound(scene, plane.members)
    return float(np.clip(1.5 * (own - max(scene.usually_bounding, 0.0)), -VOTES, VOTES))


def _called_bound(scene: Scene, members: np.ndarray) -> float:
    """Return the log odds of a bound by what masks said of vertices."""
    share = scene.areas[members] / scene.areas[members].sum()
    return float(np.log((share @ scene.bounding[members] + FAINT) / (share @ scene.furniture[members] + FAINT)))


def _keys(cells: np.ndarray) -> np.ndarray:
    return np.asarray(cells[:, 0] * (1 << 31) + cells[:, 1])
