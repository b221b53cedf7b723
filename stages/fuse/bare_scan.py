"""A scan that nobody labelled: floor, walls, ceiling and pieces by geometry alone. z is up."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.fuse.annotated_scan import AnnotatedScan
from scenewright.stages.fuse.layout.evidence import Scene
from scenewright.stages.fuse.layout.planes import LEVEL
from scenewright.stages.fuse.layout.room import CEILING, FLOOR, WALL, find_layout
from scenewright.stages.fuse.pieces import Cloud, pieces_of
from scenewright.stages.fuse.point_surface import local_axes
from scenewright.stages.kit.geometry.cells import cell_keys
from scenewright.stages.kit.geometry.point_clouds import vertex_normals

TOP, LOWEST_CEILING = 0.15, 2.0
"""Level surface so close to the highest point, and so high over the lowest, faces down [m]."""


def told_apart(scan: AnnotatedScan, voxel: float, minimum_area: float, where: Path) -> AnnotatedScan:
    """Return the scan with an instance for each piece of surface that stands free, and floor, walls and ceiling.

    Where points are farther apart than `voxel` [m], cubes as large as their distance stand for it; `minimum_area` [m^2]
    as in `pieces_of`. Raises BadInput when there is no floor.
    """
    points, edge = scan.vertices, voxel
    if not len(scan.faces):
        thinned, _ = _cubes(points, voxel)
        edge = max(voxel, float(np.median(local_axes(points[thinned])[0][:, 1])))
    first, inverse = _cubes(points, edge)
    count = np.bincount(inverse)
    middles = np.stack([np.bincount(inverse, weights=points[:, k]) / count for k in range(3)], axis=1)
    normals = vertex_normals(points, scan.faces)[first] if len(scan.faces) else _into_the_room(middles)
    nothing = np.zeros(len(middles))
    areas = np.full(len(middles), edge**2)
    layout = find_layout(Scene(middles, normals, areas, nothing, nothing, np.zeros((0, 3)), None))
    if layout.floor is None:
        raise BadInput(
            f"{where}: nothing of it is labelled, and no floor is seen",
            hint="label it, or say which axis is up (--up AXIS) and in which unit it is (--unit UNIT)",
        )
    cloud = Cloud(middles - [0.0, 0.0, layout.floor], normals, edge)
    piece = pieces_of(cloud, layout.owner == 0, minimum_area)
    most = int(piece.max(initial=0))
    names = {number: "object" for number in range(1, most + 1)}
    for number, name in enumerate((FLOOR, CEILING, WALL), most + 1):
        piece[layout.of(name)] = number
        names[number] = name
    return replace(scan, labels=piece[inverse].astype(np.int64), names=names, are_instances=True)


def _cubes(points: np.ndarray, edge: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the first point of every cube of `edge` [m] that holds any, and the cube (N,) of every point."""
    _, first, inverse = np.unique(cell_keys(points, edge), return_index=True, return_inverse=True)
    return first, inverse


def _into_the_room(points: np.ndarray) -> np.ndarray:
    """Return normals (N, 3) of points: into the middle of the scan; up where it is level, but for the very top."""
    normals = local_axes(points)[1][:, :, 0]
    across = np.einsum("nk,nk->n", normals[:, :2], np.median(points[:, :2], axis=0) - points[:, :2])
    height = points[:, 2] - points[:, 2].min()
    at_top = (height > height.max() - TOP) & (height > LOWEST_CEILING)
    flip = np.where(np.abs(normals[:, 2]) > 1 - LEVEL, (normals[:, 2] < 0) != at_top, across < 0)
    return np.where(flip[:, None], -normals, normals)
