"""Coordinate frames of a log as a tree of stamped transforms; poses in between are interpolated."""

from __future__ import annotations

from bisect import bisect_left

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from schemas.errors import BadInput
from stages.kit.geometry.transforms import inverse, transform_from


class TransformTree:
    """Edges parent -> child with samples (stamp [ns], parent_from_child). Every frame has at most one parent."""

    def __init__(self) -> None:
        self._parent: dict[str, str] = {}
        self._samples: dict[str, dict[int, np.ndarray]] = {}
        self._static: set[str] = set()
        self._sorted: dict[str, tuple[list[int], list[np.ndarray]]] = {}

    @property
    def frames(self) -> tuple[str, ...]:
        """All frames, by name."""
        return tuple(sorted(self._parent.keys() | set(self._parent.values())))

    def add(self, parent: str, child: str, stamp: int, parent_from_child: np.ndarray, static: bool = False) -> None:
        """Add a sample; of several with one stamp the first counts. Raises BadInput for a second parent."""
        known = self._parent.setdefault(child, parent)
        if known != parent:
            raise BadInput(f"frame {child!r} has two parents, {known!r} and {parent!r}", hint="the tree must be a tree")
        self._samples.setdefault(child, {}).setdefault(stamp, parent_from_child)
        self._sorted.pop(child, None)
        if static:
            self._static.add(child)

    def has_parent(self, frame: str) -> bool:
        """Whether the frame hangs below another."""
        return frame in self._parent

    def chain(self, frame: str) -> list[str]:
        """Return the frame, its parent, and so on up to the root. Raises BadInput for a loop."""
        chain = [frame]
        while chain[-1] in self._parent:
            above = self._parent[chain[-1]]
            if above in chain:
                raise BadInput(f"frames {' -> '.join([*chain, above])} form a loop")
            chain.append(above)
        return chain

    def lookup(self, target: str, source: str, stamp: int, *, gap: int, tolerance: int) -> np.ndarray | None:
        """Return target_from_source (4, 4) at `stamp` [ns], or None where the samples do not cover it.

        Samples further apart than `gap` [ns] are not interpolated; up to `tolerance` [ns] before the first or after
        the last sample that sample counts. Raises BadInput when the frames are not in one tree.
        """
        up, down = self.chain(source), self.chain(target)
        common = next((frame for frame in up if frame in down), None)
        if common is None:
            raise BadInput(f"frames {target!r} and {source!r} are not connected by transforms")
        common_from_source = self._along(up[: up.index(common)], stamp, gap, tolerance)
        common_from_target = self._along(down[: down.index(common)], stamp, gap, tolerance)
        if common_from_source is None or common_from_target is None:
            return None
        if down[0] == common:
            return common_from_source
        return inverse(common_from_target) @ common_from_source

    def is_constant(self, frame: str) -> bool:
        """Whether the edge above a frame is static or has a single sample."""
        return frame in self._static or len(self._samples[frame]) == 1

    def _along(self, children: list[str], stamp: int, gap: int, tolerance: int) -> np.ndarray | None:
        result = np.eye(4)
        for child in children:
            edge = self._edge(child, stamp, gap, tolerance)
            if edge is None:
                return None
            result = edge @ result
        return result

    def _edge(self, child: str, stamp: int, gap: int, tolerance: int) -> np.ndarray | None:
        if child not in self._sorted:
            ordered = sorted(self._samples[child].items())
            self._sorted[child] = ([time for time, _ in ordered], [matrix for _, matrix in ordered])
        times, matrices = self._sorted[child]
        if self.is_constant(child):
            return matrices[0]
        after = bisect_left(times, stamp)
        if after < len(times) and times[after] == stamp:
            return matrices[after]
        if after == 0:
            return matrices[0] if times[0] - stamp <= tolerance else None
        if after == len(times):
            return matrices[-1] if stamp - times[-1] <= tolerance else None
        if times[after] - times[after - 1] > gap:
            return None
        share = (stamp - times[after - 1]) / (times[after] - times[after - 1])
        return interpolated(matrices[after - 1], matrices[after], share)


def interpolated(first: np.ndarray, second: np.ndarray, share: float) -> np.ndarray:
    """Return the pose `share` (0..1) of the way: rotation by slerp, translation linear."""
    rotations = Rotation.from_matrix(np.stack([first[:3, :3], second[:3, :3]]))
    rotation = Slerp([0.0, 1.0], rotations)([share]).as_matrix()[0]
    return transform_from(rotation, (1 - share) * first[:3, 3] + share * second[:3, 3])
