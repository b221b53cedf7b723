"""Global bundle adjustment of the key frames (pycolmap) over the features that tracking and loops matched.

Bundle adjustment knows no scale: afterwards the depth of the features gives it back, and the result is laid onto the
poses it started from.
"""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.needed import needed
from scenewright.stages.kit.registration.pose_graph import Edge, squared_errors
from scenewright.stages.poses.estimation import Estimate
from scenewright.stages.poses.features import Features, match_features
from scenewright.stages.poses.frame_poses import largest_part
from scenewright.stages.poses.tracking import KeyFrame
from scenewright.stages.poses.world import laid_onto

LEAST_TRACKS = 30
"""Fewer tracks than this adjust nothing."""
BELIEVED = 0.5
"""Least weight, after optimisation, of an edge whose features make tracks; by eye."""
CONTRADICTION = 4.0
"""The edges that dense alignment gave may contradict the adjusted poses so much more than those before [times]."""
LOSS_SCALE = 2.0
"""Reprojection errors above this count less [pixels]."""


def adjust(estimate: Estimate, camera: Camera, logger: logging.Logger) -> Estimate:
    """Return the estimate with key frames of its largest part moved to where their features agree best.

    Without enough tracks, without scale, or where the result contradicts what the depth says (a camera that only
    turns gives features no parallax), the estimate is returned as it is, and the log says why.
    """
    poses, part = estimate.world_from_key, largest_part(estimate)
    edges = [
        edge
        for edge, weight in zip(estimate.edges, estimate.solution.weights, strict=True)
        if weight >= BELIEVED and estimate.parts[edge.target] == part == estimate.parts[edge.source]
    ]
    tracks = feature_tracks(estimate.track.keys, edges)
    if len(tracks) < LEAST_TRACKS:
        logger.warning("no bundle adjustment: %d features were seen twice", len(tracks))
        return estimate
    used = sorted({key for track in tracks for key, _ in track})
    adjusted = _bundle(estimate.track.keys, poses, tracks, used, camera)
    if adjusted is None:
        logger.warning("no bundle adjustment: its scale is unknown")
        return estimate
    motion = laid_onto(adjusted, poses[used])
    moved = poses.copy()
    moved[used] = motion @ adjusted
    before, after = mean_error(edges, poses), mean_error(edges, moved)
    if after > CONTRADICTION * max(before, 1.0):
        logger.warning("no bundle adjustment: it contradicts the depth (error %.1f instead of %.1f)", after, before)
        return estimate
    logger.info("bundle adjustment over %d features: error of the depth %.2f, was %.2f", len(tracks), after, before)
    return replace(estimate, world_from_key=moved)


def mean_error(edges: list[Edge], poses: np.ndarray) -> float:
    """Return the mean squared error per degree of freedom of edges under poses (N, 4, 4)."""
    return float(squared_errors(poses, edges).mean()) / 6


def feature_tracks(keys: list[KeyFrame], edges: list[Edge]) -> list[list[tuple[int, int]]]:
    """Return tracks, lists of (key frame, feature), of features that edges join and whose points agree with them.

    A track that holds two features of one key frame is dropped.
    """
    parent: dict[tuple[int, int], tuple[int, int]] = {}

    def root(item: tuple[int, int]) -> tuple[int, int]:
        while parent.setdefault(item, item) != item:
            parent[item] = parent[parent[item]]
            item = parent[item]
        return item

    for edge in edges:
        for target_feature, source_feature in _agreeing_features(
            keys[edge.target].features, keys[edge.source].features, edge.target_from_source
        ):
            first, second = root((edge.target, target_feature)), root((edge.source, source_feature))
            parent[max(first, second)] = min(first, second)
    groups: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for item in sorted(parent):
        groups.setdefault(root(item), []).append(item)
    return [group for group in groups.values() if len(group) > 1 and len({key for key, _ in group}) == len(group)]


def _agreeing_features(target: Features, source: Features, target_from_source: np.ndarray) -> list[tuple[int, int]]:
    pairs = match_features(target, source)
    if not len(pairs):
        return []
    moved = apply(target_from_source, source.points[pairs[:, 1]].astype(float))
    points = target.points[pairs[:, 0]].astype(float)
    agreeing = np.linalg.norm(moved - points, axis=1) < 0.03 + 0.01 * points[:, 2] ** 2
    return [(int(a), int(b)) for a, b in pairs[agreeing]]


def _bundle(
    keys: list[KeyFrame], poses: np.ndarray, tracks: list[list[tuple[int, int]]], used: list[int], camera: Camera
) -> np.ndarray | None:
    """Return the adjusted world_from_key (U, 4, 4) of the key frames `used` in metres, or None without scale."""
    pycolmap = needed("pycolmap", "bundle adjustment")

    pycolmap.logging.minloglevel = pycolmap.logging.Level.ERROR.value
    model = pycolmap.Reconstruction()
    # Its pixel centres are at halves.
    parameters = [camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5]
    model.add_camera_with_trivial_rig(
        pycolmap.Camera(model="PINHOLE", width=camera.width, height=camera.height, params=parameters, camera_id=1)
    )
    for key in used:
        image = pycolmap.Image(
            name=f"{key:06d}", keypoints=keys[key].features.pixels.astype(float) + 0.5, camera_id=1, image_id=key + 1
        )
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(inverse(poses[key])[:3]))
    for track in tracks:
        points = [apply(poses[key], keys[key].features.points[row].astype(float)) for key, row in track]
        elements = [pycolmap.TrackElement(key + 1, row) for key, row in track]
        model.add_point3D(np.mean(points, axis=0), pycolmap.Track(elements))
    options = pycolmap.BundleAdjustmentOptions(
        refine_focal_length=False, refine_extra_params=False, print_summary=False
    )
    options.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
    options.ceres.loss_function_scale = LOSS_SCALE
    options.ceres.solver_options.num_threads = 1
    pycolmap.bundle_adjustment(model, options)
    result = np.array(
        [inverse(np.vstack([model.images[key + 1].cam_from_world().matrix(), [0, 0, 0, 1]])) for key in used]
    )
    ratios = []
    for pose, key in zip(result, used, strict=True):
        camera_from_world, features = inverse(pose), keys[key].features
        for row, point in enumerate(model.images[key + 1].points2D):
            if point.has_point3D():
                modelled = apply(camera_from_world, model.points3D[point.point3D_id].xyz)[2]
                if modelled > 0:
                    ratios.append(float(features.points[row, 2]) / modelled)
    if len(ratios) < LEAST_TRACKS:
        return None
    result[:, :3, 3] *= np.median(ratios)
    return result
