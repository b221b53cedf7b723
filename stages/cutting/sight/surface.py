"""The closed surface where a field on a lattice is zero, by tetrahedra: it bounds a volume whatever the field."""

from __future__ import annotations

from itertools import permutations

import numpy as np

_UNIT = np.eye(3, dtype=np.int64)
"""Unit steps along the axes of the lattice."""
_TETRAHEDRA = np.array(
    [[np.zeros(3, int), _UNIT[a], _UNIT[a] + _UNIT[b], np.ones(3, int)] for a, b, _ in permutations(range(3))]
)
"""(6, 4, 3): a cube cut along its diagonal (Kuhn 1960); neighbouring cubes agree on their faces."""
NEAR_CORNER = 0.02
"""Share of an edge by which the surface keeps away from its ends: no triangle without area."""


def zero_surface(field: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (V, 3), in steps of the lattice, and outward faces (F, 3) around where a field (X, Y, Z) is
    positive. The field must be negative on the lattice's border."""
    values = np.where(field == 0.0, -1e-9, field)
    corners = values > 0
    mixed = np.zeros(np.array(field.shape) - 1, dtype=np.int64)
    for step in np.ndindex(2, 2, 2):
        mixed += corners[tuple(slice(s, s + n) for s, n in zip(step, mixed.shape, strict=True))]
    cubes = np.argwhere((mixed > 0) & (mixed < 8))
    places = (cubes[:, None, None] + _TETRAHEDRA).reshape(-1, 4, 3)
    inside = corners[tuple(places.transpose(2, 0, 1))]
    number = np.ravel_multi_index(tuple(places.transpose(2, 0, 1)), field.shape)
    order = np.argsort(~inside, axis=1, kind="stable")  # corners inside come first
    number = np.take_along_axis(number, order, axis=1)
    count = inside.sum(axis=1)
    edges = []
    for within, pairs in ((1, (((0, 1), (0, 2), (0, 3)),)), (3, (((0, 3), (1, 3), (2, 3)),)), (2, _QUAD)):
        mine = number[count == within]
        for triangle in pairs:
            edges.append(np.stack([mine[:, list(pair)] for pair in triangle], axis=1))
    corner_edges = np.concatenate(edges)  # (F, 3, 2): each corner of a triangle lies on an edge, its inner end first
    keys, faces = np.unique(corner_edges[..., 0] * field.size + corner_edges[..., 1], return_inverse=True)
    unique, faces = np.stack(np.divmod(keys, field.size), axis=1), faces.reshape(-1, 3)
    ends = np.stack(np.unravel_index(unique, field.shape), axis=-1).astype(float)
    inner, outer = values.ravel()[unique[:, 0]], values.ravel()[unique[:, 1]]
    share = np.clip(inner / (inner - outer), NEAR_CORNER, 1.0 - NEAR_CORNER)[:, None]
    vertices = ends[:, 0] * (1.0 - share) + ends[:, 1] * share
    middles, outwards = ends.mean(axis=1)[faces], (ends[:, 1] - ends[:, 0])[faces].sum(axis=1)
    normal = np.cross(middles[:, 1] - middles[:, 0], middles[:, 2] - middles[:, 0])
    wrong = (normal * outwards).sum(axis=1) < 0
    faces[wrong] = faces[wrong][:, ::-1]
    return vertices, faces


_QUAD = (((0, 2), (0, 3), (1, 3)), ((0, 2), (1, 3), (1, 2)))
"""The two triangles of a tetrahedron's section with four corners, by the edges that they lie on."""
