"""Demonstrations as what the networks learn from: features of every piece, cuts, planes in canonical frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.stages.cutting.demonstrations.cutter import Demonstration
from scenewright.stages.cutting.world.body import Body, Plane
from scenewright.stages.cutting.world.canonical import Canonical, canonical
from scenewright.stages.kit.geometry.transforms import inverse

POINTS, QUERIES = 256, 384
"""Surface points that the encoder sees, and places at which the decoder is asked, of each fragment."""
QUERY_VOXELS = 24
"""Voxels along the longest edge, of the grid on which the decoder is asked; by eye."""


@dataclass(frozen=True)
class Sampled:
    """Fragments in their canonical frames, scaled so that the longest edge is 1."""

    surfaces: np.ndarray
    """(N, POINTS, 6) float32: points and normals."""
    scales: np.ndarray
    """(N,): the longest edge [m]."""


@dataclass(frozen=True)
class Choice:
    """A cut as it was chosen: which of the pieces that lay there (numbers of the corpus), the plane, what came."""

    there: tuple[int, ...]
    piece: int
    plane: np.ndarray
    """(4,): n and d over the fragment's scale, canonical frame."""
    results: tuple[int, ...]
    after: tuple[int, ...]
    goal: tuple[int, ...]
    last: bool


@dataclass(frozen=True)
class Corpus:
    """Every piece of the demonstrations, by number, and every cut."""

    shapes: list[Canonical]
    choices: list[Choice]
    roots: tuple[int, ...]


def corpus_of(demonstrations: Sequence[Demonstration]) -> Corpus:
    """Return pieces and cuts; goals are what was there in the end, of demonstrations that stop midway too."""
    shapes: list[Canonical] = []
    choices: list[Choice] = []
    roots: list[int] = []
    for demonstration in demonstrations:
        start = len(shapes)
        shapes += [canonical(body) for body in demonstration.pieces]
        present = [start + k for k in range(len(demonstration.objects))]
        roots += present
        goal = tuple(start + k for k in demonstration.final)
        for number, cut in enumerate(demonstration.cuts):
            piece, results = start + cut.piece, tuple(start + k for k in cut.results)
            plane = plane_in(shapes[piece], cut.plane)
            after = tuple([k for k in present if k != piece] + list(results))
            last = demonstration.finished and number == len(demonstration.cuts) - 1
            choices.append(Choice(tuple(present), piece, plane, results, after, goal, last))
            present = list(after)
    return Corpus(shapes, choices, tuple(roots))


def plane_in(shape: Canonical, plane: Plane) -> np.ndarray:
    """Return a world plane as (4,): n and d over the scale in the fragment's frame, its largest component positive."""
    plane_in_shape = plane.moved(inverse(shape.world_from_fragment))
    values = np.append(plane_in_shape.normal, plane_in_shape.d / float(shape.size.max()))
    return np.asarray(values * np.sign(values[np.argmax(np.abs(values[:3]))]))


def plane_out(body: Body, values: np.ndarray) -> Plane:
    """Return the world plane of (4,) in a body's canonical frame."""
    shape = canonical(body)
    return Plane(values[:3], float(values[3]) * float(shape.size.max())).moved(shape.world_from_fragment)


def sampled(shapes: Sequence[Canonical]) -> Sampled:
    """Return points on the surfaces, the same ones each time."""
    surfaces = np.zeros((len(shapes), POINTS, 6), np.float32)
    scales = np.array([shape.size.max() for shape in shapes])
    for number, (shape, scale) in enumerate(zip(shapes, scales, strict=True)):
        random = np.random.default_rng(0)
        corners = shape.vertices[shape.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(normals, axis=1)
        faces = random.choice(len(corners), POINTS, p=area / area.sum())
        u, v = random.random((2, POINTS))
        flip = u + v > 1
        u, v = np.where(flip, 1 - u, u)[:, None], np.where(flip, 1 - v, v)[:, None]
        a, b, c = (corners[faces, k] for k in range(3))
        surfaces[number, :, :3] = (a + u * (b - a) + v * (c - a)) / scale
        surfaces[number, :, 3:] = normals[faces] / area[faces, None]
    return Sampled(surfaces, scales)


def queries(shapes: Sequence[Canonical], random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return places (N, QUERIES, 3) in the scaled canonical frames, half of them near the surface, and whether each
    is inside (N, QUERIES)."""
    places = np.zeros((len(shapes), QUERIES, 3), np.float32)
    inside = np.zeros((len(shapes), QUERIES), np.float32)
    for number, shape in enumerate(shapes):
        scale = float(shape.size.max())
        grid, filled = shape.voxels(scale / QUERY_VOXELS)
        padded = np.pad(filled, 2)
        edge = np.zeros(padded.shape, bool)
        for axis in range(3):
            edge |= padded != np.roll(padded, 1, axis)
        near_surface = np.argwhere(edge)
        chosen = near_surface[random.integers(len(near_surface), size=QUERIES // 2)]
        spread = np.column_stack([random.integers(n, size=QUERIES - QUERIES // 2) for n in padded.shape])
        voxels = np.concatenate([chosen, spread])
        places[number] = (grid.origin + (voxels - 2 + 0.5) * grid.voxel) / scale
        inside[number] = padded[tuple(voxels.T)]
    return places, inside
