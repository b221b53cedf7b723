"""Pairs of frames that see the same surface: which should, whether they do, and what they say of each other."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.registration.alignment import Alignment, align
from scenewright.stages.kit.registration.pose_graph import Edge
from scenewright.stages.kit.registration.pyramid import Pyramid
from scenewright.stages.kit.registration.rigid_motion import angle_of, distance_of, inverses

SYSTEMATIC = np.array([0.0015] * 3 + [0.003] * 3)
"""Errors that do not average out over pixels (lens, depth scale): standard deviations [rad] and [m]."""
RETURN_DISTANCE, RETURN_ANGLE = 0.02, math.radians(1.0)
"""Alignment there and back must end within this."""


@dataclass(frozen=True)
class Limits:
    """When an alignment is believed."""

    overlap: float
    agreement: float
    residual: float
    """[m]."""
    uncertainty: float
    """[m]."""
    brightness: float

    def good(self, alignment: Alignment) -> bool:
        """Whether an alignment is believed."""
        return (
            alignment.overlap >= self.overlap
            and alignment.agreement >= self.agreement
            and alignment.residual <= self.residual
            and alignment.uncertainty <= self.uncertainty
            and alignment.brightness_residual <= self.brightness
        )


USUAL_LIMITS = Limits(overlap=0.3, agreement=0.75, residual=0.03, uncertainty=0.05, brightness=0.1)
"""Those that `poses` has by default."""


class Sighted(Protocol):
    """What is known of a key frame without its images."""

    @property
    def sparse_points(self) -> np.ndarray:
        """(K, 3): some of what it saw, in its camera [m]."""

    @property
    def median_depth(self) -> float:
        """[m]."""


def agreed(
    target: Pyramid, source: Pyramid, guess: np.ndarray, limits: Limits, *, use_color: bool, coarsest: int | None
) -> Alignment | None:
    """Return where `source` is in `target` if the limits believe it and the alignment the other way round has found the
    same motion; None otherwise."""
    forward = align(target, source, guess, use_color=use_color, coarsest=coarsest)
    if not limits.good(forward):
        return None
    back = align(source, target, inverse(forward.target_from_source), use_color=use_color, coarsest=0)
    if not limits.good(back):
        return None
    turn = forward.target_from_source @ back.target_from_source
    return None if distance_of(turn) > RETURN_DISTANCE or angle_of(turn) > RETURN_ANGLE else forward


def with_systematic_error(information: np.ndarray) -> np.ndarray:
    """Return the information (6, 6) after adding the errors that more pixels do not reduce."""
    spread = np.linalg.inv(information + 1e-3 * np.eye(6)) + np.diag(SYSTEMATIC**2)
    result = np.linalg.inv(spread)
    return 0.5 * (result + result.T)


def edge_of(target: int, source: int, alignment: Alignment, *, switchable: bool) -> Edge:
    """Return the edge of an alignment between two key frames."""
    information = with_systematic_error(alignment.information)
    return Edge(target, source, alignment.target_from_source, information, switchable)


def overlap_candidates(
    keys: Sequence[Sighted],
    world_from_key: np.ndarray,
    cameras: Sequence[Camera],
    linked: Iterable[tuple[int, int]],
    *,
    per_key: int,
    least_overlap: float = 0.35,
) -> list[tuple[int, int]]:
    """Return pairs (earlier, later), not yet `linked`, that should see the same surface where they stand.

    `world_from_key` is (N, 4, 4), one camera a key frame. Pairs of different parts of the graph must not be asked for.
    For each later key frame the candidates are spread: the best ones that are no neighbours of one that was taken.
    """
    linked_pairs = set(linked)
    pairs = []
    for later in range(2, len(keys)):
        guesses = inverses(world_from_key[: later - 1]) @ world_from_key[later]
        shares_seen = seen_shares(keys[: later - 1], keys[later], guesses, cameras)
        shares = list(zip(shares_seen.tolist(), range(later - 1), strict=True))
        chosen: list[int] = []
        for share, earlier in sorted(shares, key=lambda entry: (-entry[0], entry[1])):
            if share < least_overlap or len(chosen) >= per_key:
                break
            if any(abs(earlier - near_by) < 2 for near_by in chosen):
                continue
            chosen.append(earlier)
        pairs += [(earlier, later) for earlier in chosen if (earlier, later) not in linked_pairs]
    return pairs


def seen_shares(
    targets: Sequence[Sighted], source: Sighted, target_from_source: np.ndarray, cameras: Sequence[Camera]
) -> np.ndarray:
    """Return the shares (T,) of what `source` saw that lie in the view of each target, of its camera, at a depth it
    could see, under motions (T, 4, 4).

    Views whose axes differ by more than 75 degrees share nothing that could be aligned.
    """
    shares = np.zeros(len(targets))
    facing = np.flatnonzero(target_from_source[:, 2, 2] >= math.cos(math.radians(75))).tolist()
    if not facing or not len(source.sparse_points):
        return shares
    x, y, z = _moved(target_from_source[facing], np.asarray(source.sparse_points, dtype=float))
    fx, fy, cx, cy, width, height, depth = np.array(
        [(c.fx, c.fy, c.cx, c.cy, c.width, c.height, targets[k].median_depth) for k in facing for c in (cameras[k],)]
    ).T[..., None]
    u, v = fx * x / np.maximum(z, 1e-6) + cx, fy * y / np.maximum(z, 1e-6) + cy
    in_range = (z > 0.2) & (z < 3 * np.maximum(depth, 0.5))
    shares[facing] = (in_range & (u >= 0) & (u < width) & (v >= 0) & (v < height)).mean(axis=1)
    return shares


def _moved(motions: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points (K, 3) under each motion (T, 4, 4), as (3, T, K)."""
    return np.einsum("tij,kj->itk", motions[:, :3, :3], points) + motions[:, :3, 3].T[..., None]
