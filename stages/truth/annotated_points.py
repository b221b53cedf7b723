"""The surface that a camera saw of the things of a support annotation, as labelled points."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.formats.entity_meshes import load_entity_mesh
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.boxes import box_volume, points_in_box, upright_box
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.truth.support_annotation import SupportAnnotation
from scipy.spatial import cKDTree

SPACING = 0.01
"""Edge of the cubes of which each holds one point [m]."""
LABEL_BITS = 16
"""Bits of a label where it shares a number with its cube."""


def seen_points(
    sequence: Sequence, *, every: int, maximum_depth: float, with_labels: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return the surface that the frames show: points (N, 3) [m] in the sequence's world, one in each cube of SPACING,
    and the value (N,) that the label images give most of the pixels there (0 without labels).

    Every `every`-th frame counts, and depth up to `maximum_depth` [m]. Raises BadInput when no frame has a pose and
    depth there, or, `with_labels`, when the sequence has no label images.
    """
    if with_labels and "labels" not in sequence.info.streams:
        raise BadInput(f"{sequence.root}: has no label images", hint="find the nodes by boxes or points instead")
    streams = ("depth", "labels") if with_labels else ("depth",)
    points, labels = [], []
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for frame in reader.frames(streams=streams, every=every):
            if frame.depth is None or frame.world_from_camera is None:
                continue
            valid = (frame.depth > 0) & (frame.depth <= maximum_depth)
            camera_points = back_project(frame.depth, reader.cameras[frame.camera_name])[valid]
            values = (
                np.zeros(len(camera_points), np.int64) if frame.labels is None else frame.labels[valid].astype(np.int64)
            )
            thinned, thinned_labels = most_common_labels(
                apply(frame.world_from_camera, camera_points.astype(float)), values
            )
            points.append(thinned)
            labels.append(thinned_labels)
    if not points or not sum(map(len, points)):
        raise BadInput(
            f"{sequence.root}: no frame has a pose and depth up to {maximum_depth:g} m",
            hint="give a sequence with poses and depth",
        )
    return most_common_labels(np.concatenate(points), np.concatenate(labels))


def most_common_labels(points: np.ndarray, labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return for each cube of SPACING that holds points (N, 3) their mean (K, 3) and most common label (K,), the
    smallest of equals. labels (N,) are 0..65535. The order is that of the cubes."""
    if not len(points):
        return np.zeros((0, 3)), np.zeros(0, np.int64)
    cubes = np.floor(points / SPACING).astype(np.int64)
    cubes -= cubes.min(axis=0)
    span = cubes.max(axis=0) + 1
    flat = (cubes[:, 0] * span[1] + cubes[:, 1]) * span[2] + cubes[:, 2]
    _, group = np.unique(flat, return_inverse=True)
    count = np.bincount(group)
    means = np.stack([np.bincount(group, weights=points[:, k]) for k in range(3)], axis=1) / count[:, None]
    pairs, votes = np.unique((group.astype(np.int64) << LABEL_BITS) | labels, return_counts=True)
    owner, label = pairs >> LABEL_BITS, pairs & ((1 << LABEL_BITS) - 1)
    order = np.lexsort((label, -votes, owner))
    first = np.unique(owner[order], return_index=True)[1]
    return means, label[order][first]


def instances_of(
    annotation: SupportAnnotation,
    points: np.ndarray,
    labels: np.ndarray,
    panoptic_map: PanopticMap | None,
    reach: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return points (M, 3) and the node (M,) that each belongs to: 1, 2, ... in the order of the file, 0 none.

    By labels: the node that has the value. By boxes: of the boxes around a point that of least volume. By points: what
    the entity of the map nearest to it, at most `reach` [m] away, shows of its surface, which is added to `points`
    (the points of the frames there are left out); where two nodes name one entity, each takes what is nearer to it.
    Raises BadInput when a node has a point and there is no map.
    """
    owner = np.zeros(len(points), dtype=np.int64)
    boxes = [(box_volume(upright_box(node.find.box)), k) for k, node in enumerate(annotation.nodes, 1) if node.find.box]
    for _, k in sorted(boxes, reverse=True):
        where = annotation.nodes[k - 1].find.box
        assert where is not None
        owner[points_in_box(upright_box(where), points)] = k
    for k, node in enumerate(annotation.nodes, 1):
        if node.find.labels:
            owner[np.isin(labels, node.find.labels)] = k
    point_of_node = {k: node.find.point for k, node in enumerate(annotation.nodes, 1) if node.find.point is not None}
    if not point_of_node:
        return points, owner
    if panoptic_map is None:
        first = annotation.nodes[min(point_of_node) - 1].name
        raise BadInput(f"node {first} is found by a point, which takes a map", hint="give --panoptic-map")
    surface, surface_owner = surface_at(panoptic_map, point_of_node, reach)
    if not len(surface):
        return points, owner
    free = cKDTree(surface).query(points, distance_upper_bound=2 * SPACING)[0] > 2 * SPACING
    return np.concatenate([points[free], surface]), np.concatenate([owner[free], surface_owner])


def surface_at(
    panoptic_map: PanopticMap, named: dict[int, tuple[float, float, float]], reach: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return thinned vertices (K, 3) [m] of the entities that lie at the points, and whose point (K,) each is."""
    keys = sorted(named)
    places = np.array([named[k] for k in keys])
    nearest = np.full(len(keys), reach)
    entity_at = np.full(len(keys), -1)
    meshes = {}
    for entity in panoptic_map.info.entities:
        if not entity.triangles:
            continue
        vertices = load_entity_mesh(panoptic_map.path(entity.mesh)).vertices
        distance = cKDTree(vertices).query(places)[0]
        nearer = distance < nearest
        nearest[nearer], entity_at[nearer] = distance[nearer], entity.instance
        meshes[entity.instance] = vertices
    surfaces, owners = [np.zeros((0, 3))], [np.zeros(0, np.int64)]
    for instance in np.unique(entity_at[entity_at >= 0]):
        of_instance = np.flatnonzero(entity_at == instance)
        thinned, _ = most_common_labels(meshes[int(instance)], np.zeros(len(meshes[int(instance)]), np.int64))
        surfaces.append(thinned)
        owners.append(np.array(keys)[of_instance[cKDTree(places[of_instance]).query(thinned)[1]]])
    return np.concatenate(surfaces), np.concatenate(owners)
