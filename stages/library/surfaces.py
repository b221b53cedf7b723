"""Surface planes of a set of convex solids: coplanar facets merged, what another solid covers taken away.

Exact polygon arithmetic in each plane: the union of the facets less the cross-section of every solid that stands on
them, so that a leg's top under a table's top is no surface, and a shelf is one between its uprights alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from scenewright.schemas.base import as_vector
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import SurfacePlane
from scenewright.stages.kit.geometry.solids import Solid
from shapely.geometry import Polygon

COVER_GAPS = (0.0005, 0.003)
"""What stands at these distances from a surface covers it [m] (a closed door before the edges of a carcass)."""
CLEARANCES = (0.008, 0.02, 0.04)
"""What hangs this little over a surface that looks up leaves no room to put things there [m]."""
JOIN_GAP = 0.004
"""Regions of one horizontal plane closer than this are one support surface [m]."""
TOO_INTRICATE = "give it fewer, or simpler, collision shapes and joints"
MINIMUM_FILL = 0.6
"""A support region fills at least this share of its rectangle (a disc 0.79)."""
UPRIGHT = 0.9
"""-a_th of equation 2.1: a plane supports when its normal's z exceeds this."""


class Sections:
    """Counts the facets and the cross-sections of solids that are looked at, whose number may grow with the square of
    that of the solids."""

    def __init__(self, most: int, where: str) -> None:
        self.most, self.taken, self._where = most, 0, where

    def take(self, count: int) -> None:
        """Count some. Raises BadInput beyond the bound."""
        self.taken += count
        if self.taken > self.most:
            raise BadInput(f"{self._where}: its surfaces take more than {self.most} cross-sections", hint=TOO_INTRICATE)


def surface_planes(
    solids: Sequence[Solid],
    *,
    minimum_share: float = 0.02,
    support_share: float = 0.004,
    support_width: float = 0.06,
    sections: Sections | None = None,
) -> tuple[SurfacePlane, ...]:
    """Return the planes of flat facets, largest first.

    A plane is kept when its exposed area is at least `minimum_share` of the surface of the bounding box. Planes that
    look up are supports: they are split into connected regions, strips narrower than `support_width` [m] (0.35 of the
    smaller horizontal extent on small things) are cut off, and `support_share` is enough. Raises BadInput when that
    takes more than `sections`.
    """
    if sections is not None:
        sections.take(sum(int((~solid.curved).sum()) for solid in solids) // 4)
    points = np.concatenate([solid.vertices for solid in solids])
    size = points.max(axis=0) - points.min(axis=0)
    surface = 2 * float(size[0] * size[1] + size[1] * size[2] + size[0] * size[2])
    width = min(support_width, 0.35 * float(size[:2].min()))
    edges = _Edges(solids)
    planes = []
    for normal, offset, area, facets in _coplanar_facets(solids):
        up = normal[2] > UPRIGHT
        least = (support_share if up else minimum_share) * surface
        if area < least:
            continue
        basis = _basis(normal)
        of_solid = np.repeat(np.arange(len(facets)), [len(corners) for corners in facets])
        union = shapely.union_all(_hulls(np.concatenate([corners @ basis.T for corners in facets]), of_solid))
        gaps = COVER_GAPS + tuple(gap for gap in CLEARANCES if up and gap <= 0.25 * size[2])
        heights = offset - np.array(gaps)
        is_near = edges.reach(normal, heights)
        if sections is not None:
            sections.take(int(is_near.sum()))
        exposed = union.difference(shapely.union_all(edges.sections(normal, heights, basis, is_near)))
        regions = _regions(exposed, width) if up else [exposed]
        for region in regions:
            if region.area < least:
                continue
            corners, narrow = _rectangle(region)
            if up and (narrow < width or not _can_be_stood_on(region, corners)):
                continue
            anchor = -offset * normal
            middle = np.asarray(region.centroid.coords[0])
            planes.append(
                SurfacePlane(
                    normal=as_vector(np.round(normal, 9) + 0.0),
                    offset=round(float(offset), 9) + 0.0,
                    area=round(region.area, 9),
                    center=as_vector(np.round(anchor + middle @ basis, 9) + 0.0),
                    corners=tuple(as_vector(np.round(anchor + corner @ basis, 9) + 0.0) for corner in corners),
                    horizontal=bool(up),
                )
            )
    planes.sort(key=lambda plane: (-round(plane.area, 6), plane.center, plane.normal))
    return tuple(planes)


def _coplanar_facets(solids: Sequence[Solid]) -> list[tuple[np.ndarray, float, float, list[np.ndarray]]]:
    """Return (unit normal, offset d of n.v + d = 0, area, facet corners per solid) of every plane of flat facets."""
    groups: dict[tuple[int, ...], tuple[list[np.ndarray], list[float], list[float], dict[int, list[np.ndarray]]]] = {}
    for number, solid in enumerate(solids):
        corners = solid.vertices[solid.faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        doubled = np.linalg.norm(cross, axis=1)
        flat = np.flatnonzero(~solid.curved & (doubled > 1e-10))
        corners, cross, doubled = corners[flat], cross[flat], doubled[flat]
        normals = cross / doubled[:, None]
        offsets = -np.array([normal @ middle for normal, middle in zip(normals, corners.mean(axis=1), strict=True)])
        keys = np.column_stack([np.round(normals * 200), np.round(offsets * 1000)]).astype(int).tolist()
        for k, key in enumerate(keys):
            entry = groups.setdefault(tuple(key), ([], [], [], {}))
            entry[0].append(normals[k] * doubled[k])
            entry[1].append(float(offsets[k] * doubled[k]))
            entry[2].append(float(doubled[k]))
            entry[3].setdefault(number, []).append(corners[k])
    planes = []
    for key in sorted(groups):
        crosses, moments, weights, facets = groups[key]
        normal = np.sum(crosses, axis=0)
        normal = normal / np.linalg.norm(normal)
        total = sum(weights)
        planes.append(
            (normal, sum(moments) / total, 0.5 * total, [np.concatenate(corners) for corners in facets.values()])
        )
    return planes


def _basis(normal: np.ndarray) -> np.ndarray:
    """Return two orthonormal directions (2, 3) in the plane, right-handed with the normal."""
    helper = np.array([1.0, 0, 0]) if abs(normal[0]) < 0.9 else np.array([0, 1.0, 0])
    first = helper - (helper @ normal) * normal
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


def _hulls(points: np.ndarray, owners: np.ndarray) -> np.ndarray:
    """Return the convex hull of each owner's points (N, 2); `owners` (N,) are 0, 0, 1, ..."""
    return np.asarray(shapely.convex_hull(shapely.multipoints(points, indices=owners)))


class _Edges:
    """The edges of convex solids, all in one row."""

    def __init__(self, solids: Sequence[Solid]) -> None:
        bounds = np.array([[solid.vertices.min(axis=0), solid.vertices.max(axis=0)] for solid in solids])
        self.center, self.half = bounds.mean(axis=1), 0.5 * (bounds[:, 1] - bounds[:, 0])
        pairs = [
            np.unique(np.sort(solid.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
            for solid in solids
        ]
        self.owner = np.repeat(np.arange(len(solids)), [len(each) for each in pairs])
        corners = [solid.vertices[each] for solid, each in zip(solids, pairs, strict=True)]
        self.start, self.end = np.concatenate(corners).transpose(1, 0, 2)

    def reach(self, normal: np.ndarray, heights: np.ndarray) -> np.ndarray:
        """Return (H, S) bool: which solids' bounding boxes cross the planes n.v + height = 0."""
        return np.abs(self.center @ normal + heights[:, None]) < self.half @ np.abs(normal)

    def sections(self, normal: np.ndarray, heights: np.ndarray, basis: np.ndarray, asked: np.ndarray) -> np.ndarray:
        """Return the cross-sections of solids with the planes n.v + height = 0, in their basis; `asked`: (H, S)."""
        start, end = self.start @ normal + heights[:, None], self.end @ normal + heights[:, None]
        plane, edge = np.nonzero(((start < 0) != (end < 0)) & asked[:, self.owner])
        if not len(edge):
            return np.empty(0, object)
        start, end = start[plane, edge], end[plane, edge]
        weight = (start / (start - end))[:, None]
        points = (self.start[edge] * (1 - weight) + self.end[edge] * weight) @ basis.T
        solids = np.unique(plane * len(self.center) + self.owner[edge], return_inverse=True)[1]
        outlines = _hulls(points, solids)
        return outlines[shapely.area(outlines) > 0]


def _regions(exposed: shapely.Geometry, width: float) -> list[shapely.Geometry]:
    """Return the connected regions, joined over gaps up to JOIN_GAP, without strips narrower than about `width` [m]."""
    half, strip = 0.5 * JOIN_GAP, 0.45 * width
    with np.errstate(divide="ignore", invalid="ignore"):  # GEOS divides by zero at corners that are nearly straight
        closed = exposed.simplify(1e-6).buffer(half, join_style="mitre").buffer(-half, join_style="mitre")
        opened = closed.buffer(-strip, join_style="mitre").buffer(strip, join_style="mitre").intersection(closed)
    polygons = list(getattr(opened, "geoms", [opened]))
    return [part for part in polygons if isinstance(part, Polygon) and not part.is_empty]


def _can_be_stood_on(region: shapely.Geometry, corners: np.ndarray) -> bool:
    """Whether the region fills most of its rectangle and its middle (no rim, no ring around a turntable)."""
    return bool(region.area >= MINIMUM_FILL * Polygon(corners).area and region.contains(region.centroid))


def _rectangle(region: shapely.Geometry) -> tuple[np.ndarray, float]:
    """Return the corners (4, 2), counter-clockwise, of the minimum-area rectangle, and its smaller edge [m].

    The axis-parallel one is taken when it is at most 1 % larger.
    """
    x0, y0, x1, y1 = region.bounds
    upright = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    turned = shapely.minimum_rotated_rectangle(region)
    corners = upright
    if isinstance(turned, Polygon) and turned.area * 1.01 < (x1 - x0) * (y1 - y0):
        corners = np.asarray(shapely.geometry.polygon.orient(turned).exterior.coords)[:4]
    lengths = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    return corners, float(lengths.min())
