"""layout.json: what was found of a room's bounds, with the reasons."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.panoptic_map import LayoutFile, LayoutPlane
from scenewright.stages.fuse.layout.evidence import Scene
from scenewright.stages.fuse.layout.openings import openings_of
from scenewright.stages.fuse.layout.room import WALL, Judged, Layout


def layout_file(layout: Layout, scene: Scene) -> LayoutFile:
    """Return the file of a layout that was found in a scene."""
    return LayoutFile(
        floor=None if layout.floor is None else round(layout.floor, 4),
        planes=tuple(_row(each, scene, layout.floor or 0.0) for each in layout.planes),
    )


def _row(each: Judged, scene: Scene, floor: float) -> LayoutPlane:
    plane, points = each.plane, scene.vertices[each.plane.members]
    along = points @ plane.axes.T
    corners = [plane.offset * plane.normal + np.quantile(along, share, axis=0) @ plane.axes for share in (0.005, 0.995)]
    bounds = each.log_odds > 0
    return LayoutPlane(
        kind=each.kind,
        bounds=bounds,
        normal=as_vector(np.round(plane.normal, 6)),
        offset=round(float(plane.offset), 4),
        area=round(each.area, 3),
        start=as_vector(np.round(corners[0], 3)),
        end=as_vector(np.round(corners[1], 3)),
        reasons={name: round(value, 3) for name, value in each.reasons.items() if value},
        log_odds=round(each.log_odds, 3),
        openings=openings_of(plane, scene, floor) if bounds and each.kind == WALL else (),
    )
