"""Connected parts of labels on a surface: small ones go to their surroundings, far ones are not of the thing."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.geometry.point_clouds import vertex_normals
from scipy.spatial import cKDTree


@compiled
def connected_parts(labels: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return for every vertex (V,) the smallest vertex that edges between equal labels (V,) connect it with."""
    parents = np.arange(labels.shape[0])
    for face in range(faces.shape[0]):
        for corner in range(3):
            first, second = faces[face, corner], faces[face, (corner + 1) % 3]
            if labels[first] != labels[second]:
                continue
            while parents[first] != first:
                parents[first] = parents[parents[first]]
                first = parents[first]
            while parents[second] != second:
                parents[second] = parents[parents[second]]
                second = parents[second]
            parents[max(first, second)] = min(first, second)
    for vertex in range(parents.shape[0]):
        parents[vertex] = parents[parents[vertex]]
    return parents


def absorb_specks(
    labels: np.ndarray, faces: np.ndarray, *, whole: frozenset[int], minimum_size: int, minimum_share: float
) -> np.ndarray:
    """Return labels (V,) in which small connected parts have taken the label of most of their neighbours.

    A part is a set of vertices of one label > 0 that triangles (F, 3) connect. It is small under `minimum_size`
    vertices, or, unless its label is in `whole`, under `minimum_share` of the label's largest part. The neighbours of a
    small part are the parts that are larger than it and not small themselves, of labels whose largest part is larger
    than that of its own (a piece of shelf board must not become part of the bottle that stands on it). Without such a
    neighbour, a part under `minimum_size` becomes 0 and others keep their
    label. Ties go to the smaller label.
    """
    if len(labels) == 0:
        return labels.copy()
    part = connected_parts(labels, faces)
    sizes = np.bincount(part, minlength=len(labels))
    largest = np.zeros(int(labels.max()) + 1, dtype=np.int64)
    np.maximum.at(largest, labels[part], sizes[part])
    divisible = ~np.isin(labels, sorted(whole))
    size = sizes[part]
    small = (labels > 0) & ((size < minimum_size) | (divisible & (size < minimum_share * largest[labels])))
    # Every edge from a small part to another one is a vote for the label behind it (inner edges count for both faces).
    edges = np.concatenate([faces[:, pair] for pair in ([0, 1], [1, 0], [1, 2], [2, 1], [2, 0], [0, 2])])
    inner, outer = edges[:, 0], edges[:, 1]
    greater = (size[outer] > size[inner]) & (largest[labels[outer]] > largest[labels[inner]])
    edges = edges[small[inner] & ~small[outer] & greater]
    replacement = np.where(sizes < minimum_size, 0, labels)
    width = int(labels.max()) + 1
    keys, votes = np.unique(part[edges[:, 0]] * width + labels[edges[:, 1]], return_counts=True)
    order = np.lexsort((-keys, votes))
    replacement[keys[order] // width] = (keys % width)[order]
    return np.where(small, replacement[part], labels)


def absorb_pieces(labels: np.ndarray, faces: np.ndarray, class_of: Mapping[int, int], *, share: float) -> np.ndarray:
    """Return labels (V,) in which small things have become part of a much larger one of their class that they touch.

    `class_of` gives the class of every label that is a thing. A thing joins the one that most edges of triangles (F, 3)
    lead to, of those of its class with more than 1 / `share` as many vertices; ties to the smaller label. Ours: a leg
    that a mask missed in most frames and took for a chair of its own in the rest is no second chair.
    """
    result = labels.copy()
    if not class_of or not len(faces):
        return result
    sizes = np.bincount(labels)
    edges = np.concatenate([faces[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    ends = labels[edges]
    ends = ends[(ends[:, 0] != ends[:, 1]) & (ends > 0).all(axis=1)]
    pairs, votes = np.unique(np.sort(ends, axis=1), axis=0, return_counts=True)
    best: dict[int, tuple[int, int]] = {}
    for (first, second), count in zip(pairs.tolist(), votes.tolist(), strict=True):
        small, large = sorted((first, second), key=lambda label: (sizes[label], -label))
        same = first in class_of and class_of[first] == class_of.get(second)
        if same and sizes[small] < share * sizes[large] and (count, -large) > best.get(small, (0, 0)):
            best[small] = (count, -large)
    final: dict[int, int] = {}
    for small in sorted(best, key=lambda label: (-sizes[label], label)):
        target = -best[small][1]
        # The larger ones come first, so that a chain ends at a label that stays.
        final[small] = final.get(target, target)
        result[labels == small] = final[small]
    return result


def spread_labels(
    labels: np.ndarray, vertices: np.ndarray, faces: np.ndarray, *, steps: int, minimum_cosine: float
) -> np.ndarray:
    """Return labels (V,) in which unlabelled vertices have taken those of their neighbours, `steps` times.

    An unlabelled vertex takes the label > 0 that most of its edges lead to, ties to the smaller number; an edge counts
    where the surface bends by less than `minimum_cosine` says, so that labels grow along a board, but not from a cup
    onto the fringe behind it. Ours: pixels at creases belong to no geometric segment and leave unlabelled seams.
    """
    if len(faces) == 0 or steps == 0:
        return labels.copy()
    result = labels.copy()
    normals = vertex_normals(vertices, faces)
    both_ways = ([0, 1], [1, 0], [1, 2], [2, 1], [2, 0], [0, 2])
    edges = np.concatenate([faces[result[faces[:, pair[0]]] == 0][:, pair] for pair in both_ways])
    edges = edges[np.einsum("ij,ij->i", normals[edges[:, 0]], normals[edges[:, 1]]) >= minimum_cosine]
    for _ in range(steps):
        useful = edges[(result[edges[:, 0]] == 0) & (result[edges[:, 1]] > 0)]
        if not len(useful):
            break
        width = int(result.max()) + 1
        keys, votes = np.unique(useful[:, 0] * np.int64(width) + result[useful[:, 1]], return_counts=True)
        order = np.lexsort((-keys, votes))
        result[keys[order] // width] = (keys % width)[order]
    return result


def drop_far_parts(
    labels: np.ndarray, vertices: np.ndarray, faces: np.ndarray, *, whole: frozenset[int], distance: float
) -> np.ndarray:
    """Return labels (V,) without the parts of things that lie apart from their largest part; those become 0.

    Euclidean clustering of the parts, as section 2.3.1 does within a frame: what is within `distance` [m] of the
    largest part, or of a part that is, belongs to the thing. A piece of floor that was segmented with a chair in every
    frame goes. Labels in `whole` (stuff) keep all their parts.
    """
    result = labels.copy()
    part = connected_parts(labels, faces)
    for label in np.unique(labels[~np.isin(labels, [0, *whole])]):
        members = np.flatnonzero(labels == label)
        names, inverse, sizes = np.unique(part[members], return_inverse=True, return_counts=True)
        if len(names) == 1:
            continue
        trees = [cKDTree(vertices[members[inverse == k]]) for k in range(len(names))]
        reached = {int(np.argmax(sizes))}
        frontier = sorted(reached)
        while frontier:
            current = frontier.pop()
            for candidate in range(len(names)):
                if candidate not in reached and _within(trees[current], trees[candidate], distance):
                    reached.add(candidate)
                    frontier.append(candidate)
        result[members[~np.isin(inverse, sorted(reached))]] = 0
    return result


def _within(first: cKDTree, second: cKDTree, distance: float) -> bool:
    small, large = (first, second) if first.n < second.n else (second, first)
    nearest, _ = large.query(small.data, distance_upper_bound=distance)
    return bool(np.isfinite(nearest).any())
