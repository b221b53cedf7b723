"""Coordinate frames of a log as a tree of stamped transforms; poses in between are interpolated."""

from __future__ import annotations

from array import array

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.geometry.transforms import inverse, transform_from
from scipy.spatial.transform import Rotation, Slerp

SAME = 100_000_000
"""Samples of an edge that stands still are kept every so many nanoseconds: a robot publishes hundreds a second for
joints that never move."""


class Track:
    """Samples (stamp [ns], parent_from_child (4, 4)) of one moving frame, in 104 bytes each."""

    def __init__(self) -> None:
        self._stamps = array("q")
        self._values = array("d")
        self._sorted: tuple[np.ndarray, np.ndarray] | None = None
        self.count = 0
        """Samples that were added."""

    def add(self, stamp: int, parent_from_child: np.ndarray) -> None:
        """Add a sample; of several with one stamp the first counts."""
        self.count += 1
        self._sorted = None
        values = array("d", np.asarray(parent_from_child, dtype=np.float64)[:3].tobytes())
        count = len(self._stamps)
        if count >= 2 and values == self._values[-12:] == self._values[-24:-12]:
            before, last = self._stamps[-2], self._stamps[-1]
            if before < last < stamp and stamp - before <= SAME:
                self._stamps[-1] = stamp
                return
        self._stamps.append(stamp)
        self._values.extend(values)

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def is_constant(self) -> bool:
        """Whether all samples are the same transform."""
        values = np.frombuffer(self._values).reshape(-1, 12)
        return bool((values == values[:1]).all())

    @property
    def first(self) -> np.ndarray:
        """The first sample (4, 4) in order of arrival."""
        return _matrix(np.frombuffer(self._values[:12]))

    def samples(self) -> tuple[np.ndarray, np.ndarray]:
        """Return stamps (N,) int64 [ns], ascending without repetition, and rows (N, 3, 4)."""
        if self._sorted is None:
            stamps = np.frombuffer(self._stamps, dtype=np.int64)
            stamps, first = np.unique(stamps, return_index=True)  # the first of equal stamps, as they arrived
            self._sorted = stamps, np.frombuffer(self._values).reshape(-1, 3, 4)[first]
        return self._sorted

    def at(self, stamp: int, *, gap: int, tolerance: int) -> np.ndarray | None:
        """Return parent_from_child (4, 4) at `stamp` [ns], or None where the samples do not cover it.

        Samples further apart than `gap` [ns] are not interpolated; up to `tolerance` [ns] before the first or after
        the last sample that sample counts.
        """
        stamps, rows = self.samples()
        after = int(np.searchsorted(stamps, stamp))
        if after < len(stamps) and stamps[after] == stamp:
            return _matrix(rows[after])
        if after == 0:
            return _matrix(rows[0]) if len(stamps) and int(stamps[0]) - stamp <= tolerance else None
        if after == len(stamps):
            return _matrix(rows[-1]) if stamp - int(stamps[-1]) <= tolerance else None
        before, then = int(stamps[after - 1]), int(stamps[after])
        if then - before > gap:
            return None
        return interpolated(_matrix(rows[after - 1]), _matrix(rows[after]), (stamp - before) / (then - before))

    def gap_at(self, stamp: int) -> int:
        """Return how far the samples before and after `stamp` are apart [ns], 0 at a sample and outside of them."""
        stamps, _ = self.samples()
        after = int(np.searchsorted(stamps, stamp))
        inside = 0 < after < len(stamps) and stamps[after] != stamp
        return int(stamps[after] - stamps[after - 1]) if inside else 0

    def why_not(self, stamp: int) -> str:
        """Return in words why there may be nothing at `stamp` [ns]."""
        stamps, _ = self.samples()
        after = int(np.searchsorted(stamps, stamp))
        if after == 0:
            return f"begins {(int(stamps[0]) - stamp) * 1e-9:.3g} s later"
        if after == len(stamps):
            return f"ended {(stamp - int(stamps[-1])) * 1e-9:.3g} s before"
        return f"has samples {(int(stamps[after]) - int(stamps[after - 1])) * 1e-9:.3g} s apart there"


class TransformTree:
    """Edges parent -> child. A frame that was given several parents follows the first, or the one towards `prefer`."""

    def __init__(self) -> None:
        self._edges: dict[str, dict[str, Track]] = {}
        """Child -> parent -> samples."""
        self._static: set[tuple[str, str]] = set()
        self._preferred: str | None = None

    @property
    def frames(self) -> tuple[str, ...]:
        """All frames, by name."""
        parents = {parent for edges in self._edges.values() for parent in edges}
        return tuple(sorted(self._edges.keys() | parents))

    @property
    def sample_count(self) -> int:
        """Transforms that were added."""
        return sum(track.count for edges in self._edges.values() for track in edges.values())

    def add(self, parent: str, child: str, stamp: int, parent_from_child: np.ndarray, static: bool = False) -> None:
        """Add a sample; of several with one stamp the first counts."""
        self._edges.setdefault(child, {}).setdefault(parent, Track()).add(stamp, parent_from_child)
        if static:
            self._static.add((parent, child))

    def prefer(self, frame: str | None) -> None:
        """Where a frame has several parents, follow the one that leads to `frame`."""
        self._preferred = frame

    def parents(self, frame: str) -> tuple[str, ...]:
        """All parents that a frame was given, in order of appearance. A tree has one at most."""
        return tuple(self._edges.get(frame, ()))

    def has_parent(self, frame: str) -> bool:
        """Whether the frame hangs below another."""
        return frame in self._edges

    def parent(self, frame: str) -> str | None:
        """The parent that counts."""
        parents = self.parents(frame)
        if len(parents) < 2 or self._preferred is None:
            return parents[0] if parents else None
        return next((parent for parent in parents if self._leads_to(parent, self._preferred)), parents[0])

    def is_preferred(self, frame: str) -> bool:
        """Whether the parent that counts is known to lead to the preferred frame."""
        parent = self.parent(frame)
        return self._preferred is not None and parent is not None and self._leads_to(parent, self._preferred)

    def _leads_to(self, frame: str, target: str) -> bool:
        visited, open_frames = {frame}, [frame]
        while open_frames:
            current = open_frames.pop()
            if current == target:
                return True
            above = [parent for parent in self.parents(current) if parent not in visited]
            visited.update(above)
            open_frames.extend(above)
        return False

    def chain(self, frame: str) -> list[str]:
        """Return the frame, its parent, and so on up to the root. Raises BadInput for a loop."""
        chain = [frame]
        while (above := self.parent(chain[-1])) is not None:
            if above in chain:
                raise BadInput(
                    f"frames {' -> '.join([*chain, above])} form a loop", hint="correct the transforms of the log"
                )
            chain.append(above)
        return chain

    def connected(self, first: str, second: str) -> bool:
        """Whether both frames hang below a common one. Raises BadInput for a loop."""
        return bool(set(self.chain(first)) & set(self.chain(second)))

    def between(self, target: str, source: str) -> list[str]:
        """Return the frames whose edges to their parents lead from `source` to `target`.

        Raises BadInput when the two are not in one tree.
        """
        up, down = self._branches(target, source)
        return [*up, *down]

    def _branches(self, target: str, source: str) -> tuple[list[str], list[str]]:
        up, down = self.chain(source), self.chain(target)
        common = next((frame for frame in up if frame in down), None)
        if common is None:
            raise BadInput(
                f"frames {target!r} and {source!r} are not connected by transforms", hint="record tf and tf_static"
            )
        return up[: up.index(common)], down[: down.index(common)]

    def lookup(self, target: str, source: str, stamp: int, *, gap: int, tolerance: int) -> np.ndarray | None:
        """Return target_from_source (4, 4) at `stamp` [ns], or None where the samples do not cover it (Track.at).

        Raises BadInput when the frames are not in one tree.
        """
        up, down = self._branches(target, source)
        common_from_source = self._along(up, stamp, gap, tolerance)
        common_from_target = self._along(down, stamp, gap, tolerance)
        if common_from_source is None or common_from_target is None:
            return None
        return inverse(common_from_target) @ common_from_source if down else common_from_source

    def why_not(self, target: str, source: str, stamp: int, *, gap: int, tolerance: int) -> str:
        """Return in words which transform `lookup` lacks at `stamp` [ns]; empty when it lacks none."""
        for frame in self.between(target, source):
            if not self.is_constant(frame) and self._track(frame).at(stamp, gap=gap, tolerance=tolerance) is None:
                return f"{self.parent(frame)!r} -> {frame!r} {self._track(frame).why_not(stamp)}"
        return ""

    def gap_at(self, target: str, source: str, stamp: int) -> int:
        """Return the largest gap [ns] that `lookup` has to interpolate over at `stamp`."""
        moving = [frame for frame in self.between(target, source) if not self.is_constant(frame)]
        return max((self._track(frame).gap_at(stamp) for frame in moving), default=0)

    def is_static(self, frame: str) -> bool:
        """Whether the edge above a frame was published as static."""
        return (self.parent(frame), frame) in self._static

    def is_constant(self, frame: str) -> bool:
        """Whether the edge above a frame is static or has a single sample."""
        return self.is_static(frame) or self._track(frame).count == 1

    def changes_though_static(self) -> list[str]:
        """Return the frames whose static edge was published with different values."""
        return sorted(child for parent, child in self._static if not self._edges[child][parent].is_constant)

    def _track(self, frame: str) -> Track:
        parent = self.parent(frame)
        assert parent is not None
        return self._edges[frame][parent]

    def _along(self, children: list[str], stamp: int, gap: int, tolerance: int) -> np.ndarray | None:
        result = np.eye(4)
        for child in children:
            track = self._track(child)
            edge = track.first if self.is_constant(child) else track.at(stamp, gap=gap, tolerance=tolerance)
            if edge is None:
                return None
            result = edge @ result
        return result


def interpolated(first: np.ndarray, second: np.ndarray, share: float) -> np.ndarray:
    """Return the pose `share` (0..1) of the way: rotation by slerp, translation linear."""
    rotations = Rotation.from_matrix(np.stack([first[:3, :3], second[:3, :3]]))
    rotation = Slerp([0.0, 1.0], rotations)([share]).as_matrix()[0]
    return transform_from(rotation, (1 - share) * first[:3, 3] + share * second[:3, 3])


def _matrix(row: np.ndarray) -> np.ndarray:
    """Return (4, 4) of the upper three rows of a transform."""
    return np.vstack([row.reshape(3, 4), [0.0, 0.0, 0.0, 1.0]])
