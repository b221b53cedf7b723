"""Frames whose depth contradicts the others where the path puts them: alignments were believed that were wrong.

Distances count in shares of the depth, so that a log whose unit is wrong is judged as one whose unit is right.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.registration.rigid_motion import inverses
from scenewright.stages.poses.frame_poses import FramePose

GRID = 80
"""Width at which depth is compared [px]."""
SAME_SURFACE = 0.03
"""Depth that differs by less than this share is of one surface: six times the systematic error of a depth camera."""
LEAST_SHARED = 0.3
"""Share of either frame that two must see of each other to be compared."""
COMPARED, LEAST_COMPARED = 5, 2
"""A frame is compared with so many others, those that share most with it; with fewer nothing is said of it."""
TRIED = 12
"""So many that may share most are looked at."""
LEAST_PIXELS = 50
"""A direction with fewer compared pixels says nothing."""


def contradicted(
    reader: FrameReader, camera: Camera, poses: Sequence[FramePose], least_agreement: float, maximum_depth: float
) -> set[int]:
    """Return the frames (indices in the sequence) of which, where their poses put them, a smaller share than
    `least_agreement` of what others should see lies on the surfaces these see.

    Compared are key frames, or all where there are none, both ways: what lies behind a surface may be hidden, what
    lies before it should have been seen. The median over them counts. Frames that fail are judged again beside those
    that do not, so that a wrong neighbour is not held against them; where none of these sees the same, nobody can say
    which is wrong, and all are.
    """
    placed = [pose for pose in poses if pose.world_from_camera is not None]
    if len(placed) <= LEAST_COMPARED:
        return set()
    views = _Views(reader, camera, placed, maximum_depth)
    keys = [row for row, pose in enumerate(placed) if pose.status == "key"]
    others = keys if len(keys) > COMPARED else list(range(len(placed)))
    failed = [
        row for row in range(len(placed)) if _below(views.agreements(row, others), LEAST_COMPARED, least_agreement)
    ]
    sound = [row for row in others if row not in failed]

    def is_cleared(row: int) -> bool:
        beside_sound = views.agreements(row, sound)
        return bool(beside_sound) and not _below(beside_sound, 1, least_agreement)

    return {placed[row].frame for row in failed if not is_cleared(row)}


def _below(agreements: Sequence[float], fewest: int, least: float) -> bool:
    return len(agreements) >= fewest and float(np.median(agreements)) < least


class _Views:
    """Coarse depth of frames with their poses."""

    def __init__(self, reader: FrameReader, camera: Camera, placed: Sequence[FramePose], maximum_depth: float) -> None:
        step = max(1, camera.width // GRID)
        first = step // 2
        self._focal = np.array([camera.fx, camera.fy]) / step
        self._center = (np.array([camera.cx, camera.cy]) - first) / step
        self._poses = np.array([pose.world_from_camera for pose in placed])
        self._inverses = inverses(self._poses)
        self._depths = []
        for pose in placed:
            depth = reader.read(pose.frame, ("depth",)).depth
            image = np.zeros((camera.height, camera.width), np.float32) if depth is None else depth
            self._depths.append(np.where(image <= maximum_depth, image, 0)[first::step, first::step].astype(np.float32))

    def agreements(self, row: int, others: Collection[int]) -> list[float]:
        """Return the shares of a frame's depth that agree with that of the others which see most of the same."""
        near = self._nearest(row, np.array([other for other in others if other != row], dtype=int))
        shares = []
        for other in near.tolist():
            there, back = self._compared(row, other), self._compared(other, row)
            shared = min(there[0], back[0])
            seen, floating = there[1] + back[1], there[2] + back[2]
            if shared >= LEAST_SHARED and seen + floating >= LEAST_PIXELS:
                shares.append((shared, seen / (seen + floating)))
        shares.sort(reverse=True)
        return [share for _, share in shares[:COMPARED]]

    def _points(self, row: int, step: int) -> np.ndarray:
        """Return points (N, 3) of every so many-th pixel of a frame, in its camera [m]."""
        depth = self._depths[row][::step, ::step]
        v, u = np.nonzero(depth)
        z = depth[v, u].astype(float)
        x, y = ((np.stack([u, v]) * step - self._center[:, None]) / self._focal[:, None]) * z
        return np.stack([x, y, z], axis=1)

    def _pixels(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return column and row, and which points (..., 3) are in view."""
        z = np.maximum(points[..., 2], 1e-6)
        u = np.floor(points[..., 0] / z * self._focal[0] + self._center[0] + 0.5)
        v = np.floor(points[..., 1] / z * self._focal[1] + self._center[1] + 0.5)
        height, width = self._depths[0].shape
        return u, v, (points[..., 2] > 0) & (u >= 0) & (v >= 0) & (u < width) & (v < height)

    def _nearest(self, row: int, others: np.ndarray) -> np.ndarray:
        """Return those of the other frames (N,) in whose view most of a frame's points are."""
        points = self._points(row, 8)
        if not len(points) or not len(others):
            return others[:0]
        motions = self._inverses[others] @ self._poses[row]
        moved = np.einsum("tij,kj->tki", motions[:, :3, :3], points) + motions[:, None, :3, 3]
        inside = self._pixels(moved)[2].mean(axis=1)
        inside[motions[:, 2, 2] <= 0.5] = 0.0  # looking another way, at the back of what it sees
        order = np.argsort(-inside, kind="stable")[:TRIED]
        return others[order[inside[order] >= LEAST_SHARED]]

    def _compared(self, source: int, target: int) -> tuple[float, int, int]:
        """Return the share of a frame's points in the view of another, and how many lie on its surface and before."""
        points = self._points(source, 2)
        if not len(points):
            return 0.0, 0, 0
        motion = self._inverses[target] @ self._poses[source]
        moved = points @ motion[:3, :3].T + motion[:3, 3]
        u, v, inside = self._pixels(moved)
        seen = self._depths[target][v[inside].astype(int), u[inside].astype(int)]
        apart = (moved[inside, 2] - seen)[seen > 0] / seen[seen > 0]
        return (float(inside.mean()), int((np.abs(apart) <= SAME_SURFACE).sum()), int((apart < -SAME_SURFACE).sum()))
