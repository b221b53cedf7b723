"""Key-frame adjustment: the poses of all views so far, moved together until what their depth and colour say agrees.

The thesis adjusts features by bundle adjustment (DROID-SLAM's, every 150 key frames; Srinivas 2024, section 9.3). Here
every view has depth: views that should see the same surface are aligned densely, both ways, and a pose graph over all
views holds these alignments beside the motions that the log gives. Views without depth are held by those alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.registration.pairs import USUAL_LIMITS, agreed, edge_of, overlap_candidates
from scenewright.stages.kit.registration.pose_graph import SWITCHES, Edge, optimize, optimize_gradually
from scenewright.stages.kit.registration.pyramid import Pyramid, build_pyramid
from scenewright.stages.kit.registration.rigid_motion import adjoint, angle_of, between, distance_of
from scenewright.stages.splat.views import PosedView

WIDTH, LEVELS, FARTHEST = 160, 3, 6.0
"""Width of the pictures that are aligned [px], their resolutions, and the farthest depth [m]; by eye."""
PER_VIEW = 2
"""Earlier views that a view is aligned with, beside the one before it, at most."""
PLACED_BY = 4
"""Adjusted views, the nearest in time, that a picture that was not learned is aligned with."""
GIVEN_STILL = np.array([0.01] * 3 + [0.01] * 3)
"""Standard deviation of a motion between neighbours as the log gives it [rad, m], without its own length."""
GIVEN_SHARE = 0.05
"""Standard deviation that is added for a motion's own length, as a share of it."""
SPARSE = 200
"""Points of a picture of which overlap is told; by eye."""


@dataclass(frozen=True)
class KeyView:
    """What is kept of a view for alignment."""

    pyramid: Pyramid
    camera: Camera
    sparse_points: np.ndarray
    median_depth: float


class Adjustment:
    """Alignments of views with each other, which grow as views arrive."""

    def __init__(self) -> None:
        self.edges: list[Edge] = []
        self.tried: set[tuple[int, int]] = set()
        self._keys: list[KeyView] = []

    def adjusted(self, views: Sequence[PosedView], world_from_camera: np.ndarray) -> np.ndarray:
        """Return the poses (N, 4, 4) of all views that agree best, the first as it was.

        `views` are those of the last call and what has arrived since, `world_from_camera` (N, 4, 4) where they stand.
        """
        self._look_at(views)
        given_poses = [view.camera_from_world for view in views]
        motions = [before @ inverse(after) for before, after in zip(given_poses, given_poses[1:], strict=False)]
        chain = [Edge(k, k + 1, motion, given_information(motion)) for k, motion in enumerate(motions)]
        neighbours = [(k, k + 1) for k in range(len(motions)) if (k, k + 1) not in self.tried]
        self._align(neighbours, world_from_camera)
        poses = optimize(world_from_camera, chain + self.edges, switch=SWITCHES[0]).world_from_node
        cameras = [key.camera for key in self._keys]
        self._align(overlap_candidates(self._keys, poses, cameras, self.tried, per_key=PER_VIEW), poses)
        return optimize_gradually(poses, chain + self.edges).world_from_node

    def placed(
        self, view: PosedView, guess: np.ndarray, views: Sequence[PosedView], world_from_camera: np.ndarray
    ) -> np.ndarray:
        """Return where a picture that takes no part (world_from_camera) stands among adjusted `views` that show the
        same, whose poses (N, 4, 4) stay; `guess` (4, 4) where it can be aligned with none."""
        self._look_at(views)
        key = key_view(view)
        order = np.argsort([abs(learned.time - view.time) for learned in views], kind="stable")
        edges = []
        for k in order[:PLACED_BY]:
            guess_between = between(world_from_camera[k], guess)
            alignment = agreed(
                self._keys[k].pyramid, key.pyramid, guess_between, USUAL_LIMITS, use_color=True, coarsest=None
            )
            if alignment is not None:
                edge = edge_of(0, 1, alignment, switchable=True)
                turned = adjoint(inverse(world_from_camera[k]))
                motion = world_from_camera[k] @ edge.target_from_source
                edges.append(replace(edge, target_from_source=motion, information=turned.T @ edge.information @ turned))
        return optimize(np.stack([np.eye(4), guess]), edges).world_from_node[1]

    def _look_at(self, views: Sequence[PosedView]) -> None:
        self._keys += [key_view(view) for view in views[len(self._keys) :]]

    def _align(self, pairs: list[tuple[int, int]], poses: np.ndarray) -> None:
        """Align pairs of views where they stand, and keep what is believed."""
        for target, source in pairs:
            self.tried.add((target, source))
            first, second = self._keys[target].pyramid, self._keys[source].pyramid
            guess = between(poses[target], poses[source])
            alignment = agreed(first, second, guess, USUAL_LIMITS, use_color=True, coarsest=None)
            if alignment is not None:
                self.edges.append(edge_of(target, source, alignment, switchable=True))


def key_view(view: PosedView) -> KeyView:
    """Return what is kept of a view."""
    depth = np.zeros(view.color.shape[:2], np.float32) if view.depth is None else view.depth
    color = np.round(255 * view.color).astype(np.uint8)
    pyramid = build_pyramid(depth, color, view.camera, width=WIDTH, levels=LEVELS, maximum_depth=FARTHEST)
    points = pyramid.levels[-1].points.reshape(-1, 3)
    points = points[points[:, 2] > 0]
    return KeyView(pyramid, view.camera, points[:: max(1, len(points) // SPARSE)], pyramid.median_depth)


def given_information(motion: np.ndarray) -> np.ndarray:
    """Return the information (6, 6) of a motion (4, 4) between neighbours as the log gives it."""
    length = np.array([angle_of(motion)] * 3 + [distance_of(motion)] * 3)
    return np.diag((GIVEN_STILL + GIVEN_SHARE * length) ** -2.0)
