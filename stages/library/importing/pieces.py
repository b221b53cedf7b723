"""Convex collision pieces: of shapes that are convex, of connected components, or by convex decomposition (CoACD).

Decompositions are kept by content: sha256 of vertices, faces, settings and the version of CoACD, in
`$XDG_CACHE_HOME/scenewright/decompositions` (`~/.cache` without it).
"""

from __future__ import annotations

import hashlib
import io
import os
import secrets
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.geometry.solids import Solid, hull, volume
from scenewright.stages.library.importing.source_model import Surface
from scenewright.stages.library.importing.versions import coacd_version
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

COACD_SETTINGS = {
    "threshold": 0.08,
    "max_convex_hull": 16,
    "preprocess_resolution": 30,
    "mcts_iterations": 50,
    "mcts_max_depth": 2,
    "seed": 0,
}
"""Coarser than CoACD's own: a chair of 700 triangles takes seconds instead of a minute."""
WORTH = 0.25
"""A hollow component with less than this share of the part's diagonal is filled."""
THINNEST = 0.001
"""Sheets are given this thickness [m]: a hull needs volume."""
WELD = 1e-5
"""Corners closer than this are one [m]."""
MOST_CORNERS = 64
"""Corners of one convex piece; rounder ones are drawn by their extremes in this many directions, twice over."""
MOST_PIECES = 48
"""Most collision pieces of one part."""
MOST_COMPONENTS = 1000
"""Connected components and solids of one part of which pieces are made: the largest."""
MOST_DECOMPOSED = 24
"""Components of one part that are cut up: the largest."""
MOST_HULL_POINTS = 50_000
"""Points of which a hull is made: more are thinned to the outermost in so many directions."""
MOST_DEPTHS = 50_000_000
"""Distances of points from facets that are looked at to tell whether an open mesh is hollow."""
CONCAVE = 0.75
"""A component that fills less than this share of its hull is concave."""
ROUND_ANGLE, ROUND_SHARE = np.radians(35.0), 0.12
"""Facets that meet another at less than this angle and have less than this share of the area stand for a curve."""
Mesh = tuple[np.ndarray, np.ndarray]


def convex_pieces(surfaces: Sequence[Surface], *, decompose: bool) -> tuple[list[Solid], list[str]]:
    """Return convex solids that stand for the surfaces [m] of one part, and what is to be said about them.

    Solids are taken as they are, connected components become their hulls. A concave component is cut up by CoACD when
    `decompose`, and is filled by its hull otherwise.
    """
    findings: list[str] = []
    solids = [surface.solid for surface in surfaces if surface.solid is not None]
    components = _components([(surface.vertices, surface.faces) for surface in surfaces if surface.solid is None])
    if len(solids) + len(components) > MOST_COMPONENTS:
        findings.append(f"of {len(solids) + len(components)} loose pieces the {MOST_COMPONENTS} largest collide")
        solids, components = _largest(solids, components)
    pieces = [piece for solid in solids if (piece := _with_volume(solid)) is not None]
    filled = cut = 0
    large = WORTH * float(np.linalg.norm(np.ptp(np.concatenate([s.vertices for s in surfaces]), axis=0)))
    for component in components:
        if is_concave(component):
            if decompose and cut < MOST_DECOMPOSED and np.linalg.norm(np.ptp(component[0], axis=0)) >= large:
                cut += 1
                pieces += [piece for points in decomposed(component) if (piece := convex_piece(points)) is not None]
                continue
            filled += 1
        piece = convex_piece(component[0])
        if piece is not None:
            pieces.append(piece)
    if filled:
        why = "small, or many" if cut == MOST_DECOMPOSED else "small" if decompose else "coacd is not used"
        findings.append(f"{filled} hollow pieces are filled by their hulls ({why})")
    pieces, dropped = _without_covered(pieces)
    if dropped:
        findings.append(f"the {MOST_PIECES} largest of {len(pieces) + dropped} collision pieces are kept")
    return pieces, findings


def _largest(solids: list[Solid], components: list[Mesh]) -> tuple[list[Solid], list[Mesh]]:
    """Return the MOST_COMPONENTS of both with the longest diagonals, in their order."""
    every = [*(solid.vertices for solid in solids), *(mesh[0] for mesh in components)]
    lengths = np.array([np.linalg.norm(np.ptp(vertices, axis=0)) for vertices in every])
    is_kept = np.zeros(len(every), dtype=bool)
    is_kept[np.lexsort((np.arange(len(every)), -lengths))[:MOST_COMPONENTS]] = True
    kept_solids = [solid for solid, keep in zip(solids, is_kept[: len(solids)], strict=True) if keep]
    return kept_solids, [mesh for mesh, keep in zip(components, is_kept[len(solids) :], strict=True) if keep]


def _with_volume(solid: Solid) -> Solid | None:
    """Return a solid of a description, thickened when it is as flat as a sheet; None for a line."""
    return convex_piece(solid.vertices) if _hull(solid.vertices) is None else solid


def _hull(points: np.ndarray) -> ConvexHull | None:
    """Return the hull, None for points that Qhull refuses: flat ones, and ones too far away for their size."""
    with suppress(QhullError, ValueError):
        return ConvexHull(points)
    return None


def thinned(points: np.ndarray) -> np.ndarray:
    """Return points (N, 3) with nearly the same hull: of more than MOST_HULL_POINTS those farthest out.

    The hull of a million points on a ball takes gigabytes; the farthest in each of many directions from the middle, and
    those at the ends of the axes, stand for them.
    """
    if len(points) <= MOST_HULL_POINTS:
        return points
    away = points - 0.5 * (points.min(axis=0) + points.max(axis=0))
    reach = np.linalg.norm(away, axis=1)
    cells = int(np.sqrt(MOST_HULL_POINTS / 6))
    axis = np.argmax(np.abs(away), axis=1)
    rows = np.arange(len(points))
    longest = away[rows, axis]
    scale = np.where(longest == 0, 1.0, np.abs(longest))
    first, second = (away[rows, (axis + k) % 3] / scale for k in (1, 2))
    face_cells = [np.minimum((0.5 * (side + 1) * cells).astype(np.int64), cells - 1) for side in (first, second)]
    cell = ((2 * axis + (longest > 0)) * cells + face_cells[0]) * cells + face_cells[1]
    order = np.lexsort((-reach, cell))
    outermost = order[np.flatnonzero(np.diff(cell[order], prepend=-1))]
    ends = [int(end) for k in range(3) for end in (np.argmin(points[:, k]), np.argmax(points[:, k]))]
    return points[np.unique(np.concatenate([outermost, ends]))]


def _components(meshes: Sequence[Mesh]) -> list[Mesh]:
    """Return the connected components of meshes, corners that lie together welded, each mesh by itself."""
    components: list[Mesh] = []
    for vertices, faces in meshes:
        _, first, number = np.unique(
            np.round(vertices / WELD).astype(np.int64), axis=0, return_index=True, return_inverse=True
        )
        points, triangles = vertices[first], number.reshape(-1)[faces]
        triangles = triangles[
            (triangles[:, 0] != triangles[:, 1])
            & (triangles[:, 1] != triangles[:, 2])
            & (triangles[:, 2] != triangles[:, 0])
        ]
        if not len(triangles):
            continue
        start, end = triangles[:, [0, 1]].reshape(-1), triangles[:, [1, 2]].reshape(-1)
        graph = coo_matrix((np.ones(len(start)), (start, end)), shape=(len(points), len(points)))
        _, label = connected_components(graph, directed=False)
        of_face = label[triangles[:, 0]]
        order = np.argsort(of_face, kind="stable")
        borders = np.flatnonzero(np.diff(of_face[order])) + 1
        for members in np.split(order, borders):
            used, inner = np.unique(triangles[members], return_inverse=True)
            components.append((points[used], inner.reshape(-1, 3)))
    return components


def is_concave(mesh: Mesh) -> bool:
    """Whether a mesh fills much less than its hull. Open meshes: whether corners lie deep inside the hull."""
    vertices, faces = mesh
    if len(vertices) < 5 or np.linalg.matrix_rank(vertices - vertices.mean(axis=0), tol=THINNEST) < 3:
        return False
    solid = _hull(thinned(vertices))
    if solid is None:
        return False
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    closed = bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())
    if closed:
        enclosed = abs(float(np.linalg.det(vertices[faces]).sum())) / 6.0
        return enclosed < CONCAVE * solid.volume
    step = 1 + len(vertices) * len(solid.equations) // MOST_DEPTHS
    depth = _depth(vertices[::step], solid.equations)
    return bool(depth.max() > 0.1 * np.ptp(vertices, axis=0).min() + THINNEST)


def _depth(points: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """Return (N,): how far inside the planes (F, 4) points (N, 3) lie, block by block."""
    block = max(1, 2_000_000 // len(planes))
    depths_of_blocks = [points[k : k + block] for k in range(0, len(points), block)]
    return np.concatenate([-(part @ planes[:, :3].T + planes[:, 3]).max(axis=1) for part in depths_of_blocks])


def convex_piece(points: np.ndarray) -> Solid | None:
    """Return the hull of points (N, 3) [m] of not too many corners, sheets thickened; None for a line."""
    points = thinned(points)
    centered = points - points.mean(axis=0)
    _, _, directions = np.linalg.svd(centered, full_matrices=False) if len(points) >= 3 else (0, 0, np.zeros((0, 3)))
    if len(directions) < 3:
        return None
    extent = np.ptp(centered @ directions.T, axis=0)
    if extent[0] < THINNEST or extent[1] < 1e-9:
        return None
    for k in (1, 2):
        if extent[k] < THINNEST:
            step = 0.5 * (THINNEST - extent[k]) * directions[k]
            points = np.concatenate([points + step, points - step])
    try:
        corners = points[ConvexHull(points).vertices]
        if len(corners) > MOST_CORNERS:
            chosen = np.unique(np.argmax(corners @ _spread(2 * MOST_CORNERS).T, axis=0))
            corners = corners[chosen]
        return _with_curves(hull(corners))
    except (QhullError, ValueError):
        return None


def _spread(count: int) -> np.ndarray:
    """Return unit directions (count + 6, 3): the axes and a spiral over the sphere (golden angle)."""
    step = np.arange(count) + 0.5
    z = 1 - 2 * step / count
    angle = step * np.pi * (3 - np.sqrt(5.0))
    ring = np.sqrt(1 - z**2)
    return np.concatenate([np.eye(3), -np.eye(3), np.column_stack([ring * np.cos(angle), ring * np.sin(angle), z])])


def _with_curves(solid: Solid) -> Solid:
    """Return the solid with those facets marked as curved that are small and bend little against a neighbour."""
    corners = solid.vertices[solid.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(cross, axis=1)
    normals = cross / np.maximum(doubled, 1e-18)[:, None]
    owner: dict[tuple[int, int], int] = {}
    flat = [(k, k) for k in range(len(solid.faces))]
    bent: list[tuple[int, int]] = []
    for k, face in enumerate(solid.faces.tolist()):
        for a, b in ((face[0], face[1]), (face[1], face[2]), (face[2], face[0])):
            first_owner = owner.setdefault((min(a, b), max(a, b)), k)
            if first_owner == k:
                continue
            angle = float(np.arccos(np.clip(normals[k] @ normals[first_owner], -1, 1)))
            if angle < np.radians(0.6):
                flat.append((k, first_owner))
            elif angle < ROUND_ANGLE:
                bent.append((k, first_owner))
    rows, columns = np.array(flat).T
    graph = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(len(solid.faces),) * 2)
    _, group = connected_components(graph, directed=False)
    share = np.bincount(group, weights=doubled) / doubled.sum()
    curved_groups = {int(group[k]) for pair in bent for k in pair if share[group[k]] < ROUND_SHARE}
    return Solid(solid.vertices, solid.faces, np.isin(group, sorted(curved_groups)))


def _without_covered(pieces: list[Solid]) -> tuple[list[Solid], int]:
    """Return the MOST_PIECES largest pieces, without those that lie wholly inside one of them, and how many more."""
    kept_pieces: list[Solid] = []
    planes: list[np.ndarray] = []
    dropped = 0
    for piece in sorted(
        pieces, key=lambda solid: (-round(volume(solid), 12), *np.round(solid.vertices.min(axis=0), 9))
    ):
        if any((piece.vertices @ p[:, :3].T + p[:, 3] <= 1e-6).all() for p in planes):
            continue
        if len(kept_pieces) == MOST_PIECES:
            dropped += 1
            continue
        solid_hull = _hull(piece.vertices)
        if solid_hull is not None:
            kept_pieces.append(piece)
            planes.append(solid_hull.equations)
    return kept_pieces, dropped


def decomposed(mesh: Mesh) -> list[np.ndarray]:
    """Return the corners (N, 3) of the convex parts of a mesh, by CoACD or out of the cache."""
    vertices = np.ascontiguousarray(mesh[0], dtype=np.float64)
    faces = np.ascontiguousarray(mesh[1], dtype=np.int32)
    settings = repr((sorted(COACD_SETTINGS.items()), coacd_version(), vertices.shape, faces.shape)).encode()
    key = hashlib.sha256(settings + vertices.tobytes() + faces.tobytes()).hexdigest()
    path = cache_folder() / f"{key}.npz"
    hulls = _read_cached(path)
    if hulls is None:
        import coacd

        coacd.set_log_level("error")
        decomposition = coacd.run_coacd(coacd.Mesh(vertices, faces), **COACD_SETTINGS)
        hulls = [np.asarray(points, dtype=np.float64) for points, _ in decomposition]
        _write_cached(path, hulls)
    return hulls


def cache_folder() -> Path:
    """Return where decompositions are kept; it need not exist yet."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "scenewright" / "decompositions"


def _read_cached(path: Path) -> list[np.ndarray] | None:
    if not path.is_file():
        return None
    with suppress(BadInput):  # a damaged file of the cache is made again
        points, sizes = read_arrays(path, "points", "sizes")
        if points.ndim == 2 and points.shape[1] == 3 and sizes.sum() == len(points) and np.isfinite(points).all():
            return np.split(points, np.cumsum(sizes)[:-1])
    return None


def _write_cached(path: Path, hulls: list[np.ndarray]) -> None:
    buffer = io.BytesIO()
    np.savez(buffer, points=np.concatenate(hulls), sizes=np.array([len(part) for part in hulls]))
    partial = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    with suppress(OSError):  # without a cache it only takes longer
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_bytes(buffer.getvalue())
        os.replace(partial, path)
