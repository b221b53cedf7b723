"""Odometry: every frame is aligned with the current key frame; what cannot be aligned begins a new part.

A part is a stretch of frames whose relative poses are known. Loops may join parts later (stages/poses/loops.py);
frames of parts that nothing joins with the largest one stay without a pose.

Where poses are given, the motion between two frames is theirs, and only looked for where the depth denies it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.registration.alignment import Alignment, align, judge
from scenewright.stages.kit.registration.pairs import Limits
from scenewright.stages.kit.registration.pyramid import Pyramid
from scenewright.stages.kit.registration.rigid_motion import angle_of, between, distance_of, exponential
from scenewright.stages.poses.features import Features, ransac_motion

LEAST_DEPTH_SHARE = 0.03
"""A frame with depth on fewer of its pixels cannot be tracked."""
GIVEN_TURN, GIVEN_WAY = math.radians(0.3), 0.01
"""Stated uncertainty of given poses: standard deviations that a metre of way adds, or a radian of turning, along each
axis [rad and m]. Steps count as independent: over a hundred metres these make 3 degrees and 10 cm. So tight that depth
that slides along a bare wall does not take the path with it; by eye."""
SEARCH_ANGLES = (math.radians(8), math.radians(16))
"""Turns about each axis that are tried when nothing else helps."""


@dataclass(frozen=True)
class TrackingLimits(Limits):
    """When an alignment is believed, and when a new key frame is due."""

    key_overlap: float
    key_angle: float
    """[rad]."""
    key_distance: float
    """Times the median depth of the key frame."""


@dataclass
class KeyFrame:
    """What is kept of a key frame; its images are read again when they are needed."""

    frame: int
    """Index in the sequence."""
    part: int
    part_from_key: np.ndarray
    """(4, 4): pose in the coordinates of the part's first key frame."""
    features: Features
    fern_code: np.ndarray
    sparse_points: np.ndarray
    """(K, 3) float32: some of what it saw, in its camera [m]."""
    median_depth: float


@dataclass(frozen=True)
class TrackedFrame:
    """Where one frame is."""

    frame: int
    key: int | None
    """Key frame it was aligned with; None when it has no pose."""
    key_from_frame: np.ndarray
    alignment: Alignment | None
    """None for the key frame itself and for frames without pose."""
    fault: str = ""
    """Why it has no pose, or why tracking had to begin anew here."""


@dataclass(frozen=True)
class KeyLink:
    """Odometry between two key frames of one part."""

    target: int
    source: int
    alignment: Alignment


@dataclass
class Track:
    """The result of odometry."""

    keys: list[KeyFrame] = field(default_factory=list)
    frames: list[TrackedFrame] = field(default_factory=list)
    links: list[KeyLink] = field(default_factory=list)
    rescues: dict[str, int] = field(default_factory=dict)
    """How often something else than the usual guess was needed."""


@dataclass(frozen=True)
class Seen:
    """A frame as tracking needs it."""

    frame: int
    pyramid: Pyramid
    describe: Callable[[], Features]
    """Finds its features; called only when they are needed."""
    describe_depth: Callable[[], np.ndarray]


class Tracker:
    """Takes frames in order."""

    def __init__(
        self,
        limits: TrackingLimits,
        use_color: bool,
        random: np.random.Generator,
        given: Mapping[int, np.ndarray] | None = None,
    ) -> None:
        """`given`: frame (index in the sequence) -> world_from_camera (4, 4) that is refined; none by default."""
        self.track = Track()
        self._limits, self._use_color, self._random = limits, use_color, random
        self._given = given or {}
        self._key: Seen | None = None
        self._previous: Seen | None = None
        self._key_from_previous = np.eye(4)
        self._motion = np.eye(4)
        """previous_from_current of the last step: the next one is expected to be like it."""
        self._link: Alignment | None = None
        self._features: tuple[int, Features] | None = None

    def add(self, seen: Seen) -> None:
        """Track one frame."""
        given = self._as_given(seen)
        if seen.pyramid.depth_share < LEAST_DEPTH_SHARE:
            if given is not None:
                self._hang_on_key(seen, given)
                return
            self.track.frames.append(TrackedFrame(seen.frame, None, np.eye(4), None, "no_depth"))
            self._motion = np.eye(4)
            return
        if self._key is None:
            self._begin_part(seen, "")
            return
        is_denied = given is None or given.agreement < self._limits.agreement
        alignment = (self._locate(seen, given) if is_denied else None) or given
        if alignment is None:
            self._begin_part(seen, "lost")
            return
        limits, key = self._limits, self.track.keys[-1]
        self._motion = inverse(self._key_from_previous) @ alignment.target_from_source
        self._key_from_previous, self._previous = alignment.target_from_source, seen
        due = (
            alignment.overlap < limits.key_overlap
            or angle_of(alignment.target_from_source) > limits.key_angle
            or distance_of(alignment.target_from_source) > limits.key_distance * key.median_depth
        )
        if due:
            self.track.frames.append(self._continue_part(seen, alignment))
        else:
            self._hang_on_key(seen, alignment)

    def _hang_on_key(self, seen: Seen, alignment: Alignment) -> None:
        number = len(self.track.keys) - 1
        self.track.frames.append(TrackedFrame(seen.frame, number, alignment.target_from_source, alignment))

    def _as_given(self, seen: Seen) -> Alignment | None:
        """Return where the given poses put a frame in the key frame, and what the depth says of that."""
        if self._key is None or self._key.frame not in self._given or seen.frame not in self._given:
            return None
        motion = between(self._given[self._key.frame], self._given[seen.frame])
        judged = judge(self._key.pyramid, seen.pyramid, motion)
        steps = max(distance_of(motion) + angle_of(motion), 1e-3)
        information = np.diag(np.repeat([GIVEN_TURN**-2.0, GIVEN_WAY**-2.0], 3)) / steps
        return replace(judged, information=information)

    def _locate(self, seen: Seen, given: Alignment | None) -> Alignment | None:
        """Return where a frame is in the key frame, trying one guess after the other; None when it is lost."""
        assert self._key is not None and self._previous is not None
        expected = self._key_from_previous @ self._motion if given is None else given.target_from_source
        alignment = self._try(self._key, seen, expected)
        if alignment is None:
            alignment = self._try(self._key, seen, self._key_from_previous)
            self._note(alignment, "no_motion")
        if alignment is None and self._previous.frame != self._key.frame:
            step = self._try(self._previous, seen, self._motion) or self._try(self._previous, seen, np.eye(4))
            self._note(step, "from_previous")
            if step is None:
                step = self._search(self._previous, seen)
            if step is not None:
                # The frame before becomes the key frame: it sees more of this one than the old one does.
                self._promote_previous()
                return step
        return alignment if alignment is not None else self._search(self._key, seen)

    def _search(self, target: Seen, seen: Seen) -> Alignment | None:
        """Look for a frame by features, then by turning it about."""
        match = ransac_motion(self._features_of(target), seen.describe(), self._random)
        if match is not None:
            alignment = self._try(target, seen, match.target_from_source)
            self._note(alignment, "features")
            if alignment is not None:
                return alignment
        best = None
        for twist in _turns():
            trial = align(target.pyramid, seen.pyramid, exponential(twist), use_color=self._use_color)
            if self._limits.good(trial) and (best is None or trial.overlap * trial.agreement > best[0]):
                best = (trial.overlap * trial.agreement, trial)
        self._note(best, "search")
        return best[1] if best is not None else None

    def _try(self, target: Seen, seen: Seen, guess: np.ndarray) -> Alignment | None:
        alignment = align(target.pyramid, seen.pyramid, guess, use_color=self._use_color)
        return alignment if self._limits.good(alignment) else None

    def _note(self, alignment: object, how: str) -> None:
        if alignment is not None:
            self.track.rescues[how] = self.track.rescues.get(how, 0) + 1

    def _features_of(self, seen: Seen) -> Features:
        if self._features is None or self._features[0] != seen.frame:
            self._features = (seen.frame, seen.describe())
        return self._features[1]

    def _promote_previous(self) -> None:
        """Make a key frame of the last frame that was tracked; frames without depth may have come after it."""
        previous = self._previous
        assert previous is not None
        index = next(k for k in reversed(range(len(self.track.frames))) if self.track.frames[k].frame == previous.frame)
        alignment = self.track.frames[index].alignment
        assert alignment is not None
        self.track.frames[index] = self._continue_part(previous, alignment)

    def _begin_part(self, seen: Seen, fault: str) -> None:
        part = self.track.keys[-1].part + 1 if self.track.keys else 0
        self.track.frames.append(self._add_key(seen, part, np.eye(4), fault))

    def _continue_part(self, seen: Seen, alignment: Alignment) -> TrackedFrame:
        """Make a key frame of a frame of the current part; return its entry."""
        key = self.track.keys[-1]
        number = len(self.track.keys)
        self.track.links.append(KeyLink(number - 1, number, alignment))
        motion = self._motion
        entry = self._add_key(seen, key.part, key.part_from_key @ alignment.target_from_source, "")
        self._motion = motion
        return entry

    def _add_key(self, seen: Seen, part: int, part_from_key: np.ndarray, fault: str) -> TrackedFrame:
        number = len(self.track.keys)
        level = seen.pyramid.levels[-1]
        points = level.points.reshape(-1, 3)
        points = points[points[:, 2] > 0]
        self.track.keys.append(
            KeyFrame(
                seen.frame,
                part,
                part_from_key,
                self._features_of(seen),
                seen.describe_depth(),
                points[:: max(1, len(points) // 200)].copy(),
                seen.pyramid.median_depth,
            )
        )
        self._key = self._previous = seen
        self._key_from_previous, self._motion = np.eye(4), np.eye(4)
        return TrackedFrame(seen.frame, number, np.eye(4), None, fault)


def _turns() -> Iterator[np.ndarray]:
    """Twists (6,) that are tried as guesses: none, then turns about each axis and combinations of two."""
    yield np.zeros(6)
    for angle in SEARCH_ANGLES:
        for axis in range(3):
            for sign in (1.0, -1.0):
                twist = np.zeros(6)
                twist[axis] = sign * angle
                yield twist
