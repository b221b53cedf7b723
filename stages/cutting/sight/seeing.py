"""Bodies out of depth pictures: clouds fused, segmented, each segment carved out of what no camera saw through."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.stages.cutting.sight.surface import zero_surface
from scenewright.stages.cutting.sight.views import View
from scenewright.stages.cutting.world.body import Body
from scenewright.stages.kit.geometry.cameras import back_project, project
from scenewright.stages.kit.geometry.point_clouds import clusters
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scipy.ndimage import gaussian_filter, grey_dilation, label

ABOVE = 0.003
"""Height over the board from which points belong to what lies there [m]: the noise of the board is below."""
APART = 0.012
"""Distance between points of different fragments [m]."""
FEWEST = 40
"""Points of a fragment: fewer are flying pixels, or a corner that no camera saw."""
LATTICE = 40
"""Steps along a fragment's longest edge, but none finer or coarser than these [m]."""
FINEST, COARSEST = 0.0008, 0.0025
"""Finest and coarsest step of the lattice that is carved [m]; by eye."""
DOUBT = 0.15
"""Share of volume by which what two cameras see may be off. Where wanted and seen volume differ by less, nothing is
left over or missing."""
DOUBT_OF_ONE = 0.35
"""The same of one camera: undersides that it does not see are filled down to the board."""
BLUR = 0.8
"""Steps over which noise is evened out."""


def see(views: Sequence[View]) -> list[Body]:
    """Return a closed body for each fragment that views show, largest cloud first; nothing below the board.

    What no camera saw is filled: under overhangs down to where both lines of sight meet, or to the board.
    """
    clouds = []
    for view in views:
        in_camera = back_project(view.depth, view.camera)[view.depth > 0].astype(float)
        points = apply(view.world_from_camera, in_camera)
        clouds.append(points[points[:, 2] > ABOVE])
    points = np.concatenate(clouds)
    if len(points) < FEWEST:
        return []
    which = clusters(points, APART)
    segments = [points[which == k] for k in range(int(which.max()) + 1)]
    return [body for segment in segments if len(segment) >= FEWEST for body in _carve(segment, views)]


def _carve(segment: np.ndarray, views: Sequence[View]) -> list[Body]:
    """Return the bodies around a segment's points (N, 3): where flying pixels joined fragments, carving parts them."""
    low, high = segment.min(axis=0), segment.max(axis=0)
    low[2] = 0.0
    step = float(np.clip((high - low).max() / LATTICE, FINEST, COARSEST))
    low, high = low - 4 * step, high + 4 * step
    shape = np.ceil((high - low) / step).astype(int) + 1
    places = low + step * np.moveaxis(np.indices(shape), 0, -1)
    field = places[..., 2].copy()  # the board bounds it from below
    for view in views:
        np.minimum(field, _behind(places.reshape(-1, 3), view).reshape(field.shape), out=field)
    field = gaussian_filter(np.clip(field, -3 * step, 3 * step), BLUR)
    for axis in range(3):
        for end in (0, -1):
            np.moveaxis(field, axis, 0)[end] = -step
    components, _ = label(field > 0)
    of_points = grey_dilation(components, 3)[tuple(np.round((segment - low) / step).astype(int).T)]
    bodies = []
    for number in np.flatnonzero(np.bincount(of_points, minlength=1)[1:] >= FEWEST) + 1:
        alone = np.where((components != number) & (field > 0), -1e-3 * step, field)
        vertices, faces = zero_surface(alone)
        bodies.append(Body.of_mesh(low + step * vertices, faces))
    return bodies


def _behind(places: np.ndarray, view: View) -> np.ndarray:
    """Return how far places (N, 3) lie behind the surface that a view shows (N,) [m]; where it shows none, behind."""
    pixels, z = project(apply(inverse(view.world_from_camera), places), view.camera)
    u, v = np.round(np.nan_to_num(pixels, nan=-1.0)).astype(int).T
    inside = (u >= 0) & (v >= 0) & (u < view.camera.width) & (v < view.camera.height)
    depth = np.zeros(len(places))
    depth[inside] = view.depth[v[inside], u[inside]]
    return np.where(depth > 0, z - depth, np.inf)
