"""Our estimator of the needle's pose from one stereo view, with its covariance, or an abstention."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from stages.suture.needle.arc import Arc, place_arc, tip_at_start
from stages.suture.needle.filter import either_way
from stages.suture.needle.observation import NeedleEstimate, NeedleObservation
from stages.suture.needle.refine import CircleFit, EyeMask, refine
from stages.suture.needle.starts import (
    FARTHEST,
    NEAREST,
    SCORED,
    TRIPLES,
    circles_through,
    frame_of,
    row_points,
    score,
)
from stages.suture.rig import NeedlePose, StereoRig

MARGIN = 40
FEWEST_PIXELS = 30
KEPT_STARTS = 8
FINALISTS = 6
EXPLAINED_WEIGHT = 60.0
"""Of the score (0 to 2) against the log-likelihood when finalists are compared."""
WIDE_BANDS = (12.0, 10.0, 8.0, 6.0, 5.0, 4.0)
NARROW_BANDS = (4.0, 3.0, 3.0, 2.5, 2.5)
LARGEST_TURN = np.radians(9.0)
LARGEST_SHIFT = 0.0016
LEAST_SEEN = 0.15
TEMPERATURE = 2.0
"""Of the scores by which other poses count in the covariance."""
EDGE_ON_SCALE, EDGE_ON_ANGLE = 4.0, 15.0
"""Near edge-on both halves of the ring run into one mask, and middles of its runs err alike: the fit's covariance is
larger by this factor (beside one) where the needle is edge-on, less over this angle [degrees]. Both of these, as the
temperature, were chosen on tuning seeds so that ellipsoids hold what they should."""
LEAST_LEAD = 3.0
"""By so much (log-likelihood and weighted score) the pose must beat the best one elsewhere."""


@dataclass(frozen=True)
class _Candidate:
    fit: CircleFit
    score: float


@dataclass(frozen=True)
class _Final:
    score: float
    fit: CircleFit
    arc: Arc

    @property
    def pose(self) -> NeedlePose:
        """The pose whose tip is the arc's start."""
        normal = self.fit.frame[:, 2]
        x_axis = np.cos(self.arc.start) * self.fit.frame[:, 0] + np.sin(self.arc.start) * self.fit.frame[:, 1]
        matrix = np.eye(4)
        matrix[:3, :3] = np.stack([x_axis, np.cross(normal, x_axis), normal], axis=1)
        matrix[:3, 3] = self.fit.centre
        return NeedlePose(matrix)


def estimate(observation: NeedleObservation, seed: int = 0, guess: NeedlePose | None = None) -> NeedleEstimate:
    """Return the needle's pose, covariance and the probability that its tip is the tip; or an abstention.

    `guess`, such as the last frame's pose, is one more start; the answer does not lean on it. Raises BadInput for a
    rig or images that cannot be.
    """
    observation.check()
    rig = observation.rig
    counts = tuple(
        int(_without(mask, thread).sum())
        for mask, thread in (
            (observation.left_mask, observation.left_thread),
            (observation.right_mask, observation.right_thread),
        )
    )
    if min(counts) < FEWEST_PIXELS:
        side = "left" if counts[0] <= counts[1] else "right"
        return NeedleEstimate.none(f"The {side} eye sees {min(counts)} pixels of needle; {FEWEST_PIXELS} are needed.")
    eyes = (
        _window(_without(observation.left_mask, observation.left_thread), observation.left_hidden),
        _window(_without(observation.right_mask, observation.right_thread), observation.right_hidden),
    )
    swapped = _eyes_swapped(rig, observation)
    if swapped:
        return NeedleEstimate.none(swapped)
    distances = (_distance_to_mask(eyes[0]), _distance_to_mask(eyes[1]))
    random = np.random.default_rng(seed)
    pixels = (_some_pixels(eyes[0], 90, random), _some_pixels(eyes[1], 90, random))
    candidates = _candidates(observation, eyes, distances, pixels, guess, random)
    if not candidates:
        return NeedleEstimate.none("No circle of the needle's radius passes through what both eyes see.")
    chosen = _chosen(rig, eyes, candidates, distances, pixels)
    if isinstance(chosen, str):
        return NeedleEstimate.none(chosen)
    return _answer(observation, chosen)


def _chosen(
    rig: StereoRig,
    eyes: tuple[EyeMask, EyeMask],
    candidates: list[_Candidate],
    distances: tuple[np.ndarray, np.ndarray],
    pixels: tuple[np.ndarray, np.ndarray],
) -> list[_Final] | str:
    """Return the best few circles after a close fit, best first; or why there is none. Best is the likelihood of what
    lies on the circle together with the share of the masks that the circle explains."""
    distinct: list[CircleFit] = []
    for candidate in candidates:
        fit = candidate.fit
        if candidate.score > 0 and all(_differ(fit.frame, fit.centre, o.frame, o.centre, 4.0, 0.001) for o in distinct):
            distinct.append(fit)
        if len(distinct) == FINALISTS:
            break
    if not distinct:
        return "No circle of the needle's radius passes through what both eyes see."
    finals = []
    for fit in distinct:
        arc = place_arc(fit)
        fit = refine(rig, eyes, fit.frame, fit.centre, NARROW_BANDS, fit.shift, (arc.start + np.pi / 2, 1.75))
        arc = place_arc(fit)
        explained = score(rig, fit.frame, fit.centre, fit.shift, distances, eyes, pixels)
        finals.append(_Final(arc.likelihood + EXPLAINED_WEIGHT * explained, fit, arc))
    return sorted(finals, key=lambda final: -final.score)


def _without(mask: np.ndarray, thread: np.ndarray | None) -> np.ndarray:
    """Return the needle's mask without what is known to be thread."""
    return mask if thread is None else mask & ~thread


def _window(mask: np.ndarray, hidden: np.ndarray | None) -> EyeMask:
    """Return the part of an eye's mask that holds all of it, with a margin, smoothed."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    top, bottom = max(int(rows[0]) - MARGIN, 0), min(int(rows[-1]) + MARGIN, mask.shape[0])
    left, right = max(int(columns[0]) - MARGIN, 0), min(int(columns[-1]) + MARGIN, mask.shape[1])
    crop = mask[top:bottom, left:right]
    soft = cv2.GaussianBlur(crop.astype(np.float32), (3, 3), 0.7)
    covered = np.zeros(crop.shape, dtype=bool) if hidden is None else hidden[top:bottom, left:right]
    return EyeMask(soft, np.ascontiguousarray(covered), left, top)


def _eyes_swapped(rig: StereoRig, observation: NeedleObservation) -> str:
    """Return a sentence if the needle lies farther right in the right eye, which no point in front of both can."""
    left, right = (np.flatnonzero(m.any(axis=0)) for m in (observation.left_mask, observation.right_mask))
    ends = left[0] - right[0], left[-1] - right[-1]
    if max(ends) < 0.5 * rig.focal * rig.baseline / FARTHEST:
        return (
            f"The needle lies {ends[0]:.0f} to {ends[1]:.0f} px farther left in the right eye than in the left; "
            f"nearer than {FARTHEST} m it would be {rig.focal * rig.baseline / FARTHEST:.0f} px or more. "
            "Are left and right exchanged?"
        )
    return ""


def _distance_to_mask(eye: EyeMask) -> np.ndarray:
    return cv2.distanceTransform((eye.soft < 0.5).astype(np.uint8), cv2.DIST_L2, 3)


def _some_pixels(eye: EyeMask, count: int, random: np.random.Generator) -> np.ndarray:
    """Return about `count` (P, 2) pixels (column, row) of the mask in the whole image."""
    rows, columns = np.nonzero(eye.soft >= 0.5)
    chosen = random.integers(0, len(rows), count) if len(rows) else np.empty(0, dtype=int)
    return np.stack([columns[chosen] + eye.column, rows[chosen] + eye.row], axis=1).astype(float)


def _disparity_points(observation: NeedleObservation, random: np.random.Generator) -> np.ndarray:
    """Return up to 500 points (N, 3) [m] of the left mask's disparity."""
    if observation.disparity is None:
        return np.empty((0, 3))
    rows, columns = np.nonzero(observation.left_mask)
    if len(rows) > 500:
        chosen = random.choice(len(rows), 500, replace=False)
        rows, columns = rows[chosen], columns[chosen]
    points = observation.rig.triangulate(np.stack([columns, rows], axis=1), observation.disparity[rows, columns])
    usable = np.isfinite(points).all(axis=1) & (points[:, 2] > NEAREST) & (points[:, 2] < FARTHEST)
    return points[usable]


def _candidates(
    observation: NeedleObservation,
    eyes: tuple[EyeMask, EyeMask],
    distances: tuple[np.ndarray, np.ndarray],
    pixels: tuple[np.ndarray, np.ndarray],
    guess: NeedlePose | None,
    random: np.random.Generator,
) -> list[_Candidate]:
    """Return refined circles, best first."""
    rig = observation.rig
    no_shift = np.zeros(2)
    starts = []
    for points in (row_points(rig, eyes), _disparity_points(observation, random)):
        centres, normals = circles_through(points, TRIPLES, random)
        for centre, normal in zip(centres[:SCORED], normals[:SCORED], strict=True):
            frame = frame_of(normal)
            starts.append((score(rig, frame, centre, no_shift, distances, eyes, pixels), frame, centre))
    starts.sort(key=lambda start: -start[0])
    if guess is not None:
        starts.insert(0, (2.0, guess.camera_from_needle[:3, :3].copy(), guess.centre.copy()))
    kept: list[tuple[np.ndarray, np.ndarray]] = []
    for _, frame, centre in starts:
        if all(_differ(frame, centre, other[0], other[1], 12.0, 0.0025) for other in kept):
            kept.append((frame, centre))
        if len(kept) == KEPT_STARTS:
            break
    candidates = []
    for frame, centre in kept:
        candidates.append(_refined(rig, eyes, distances, pixels, frame, centre))
    candidates.sort(key=lambda candidate: -candidate.score)
    for candidate in candidates[:2]:
        # one eye cannot tell a plane from its mirror image about the line of sight, and two near eyes hardly can
        sight = candidate.fit.centre / np.linalg.norm(candidate.fit.centre)
        normal = candidate.fit.frame[:, 2]
        mirrored = 2.0 * (normal @ sight) * sight - normal
        candidates.append(_refined(rig, eyes, distances, pixels, frame_of(mirrored), candidate.fit.centre))
    candidates.sort(key=lambda candidate: -candidate.score)
    return candidates


def _refined(
    rig: StereoRig,
    eyes: tuple[EyeMask, EyeMask],
    distances: tuple[np.ndarray, np.ndarray],
    pixels: tuple[np.ndarray, np.ndarray],
    frame: np.ndarray,
    centre: np.ndarray,
) -> _Candidate:
    fit = refine(rig, eyes, frame, centre, WIDE_BANDS)
    if not np.isfinite(fit.centre).all() or not NEAREST < fit.centre[2] < FARTHEST:
        return _Candidate(fit, -1.0)
    return _Candidate(fit, score(rig, fit.frame, fit.centre, fit.shift, distances, eyes, pixels))


def _differ(
    frame: np.ndarray, centre: np.ndarray, other_frame: np.ndarray, other_centre: np.ndarray, degrees: float, far: float
) -> bool:
    cosine = abs(float(frame[:, 2] @ other_frame[:, 2]))
    return cosine < np.cos(np.radians(degrees)) or float(np.linalg.norm(centre - other_centre)) > far


def _answer(observation: NeedleObservation, finals: list[_Final]) -> NeedleEstimate:
    """Return the best pose with its covariance, or abstain where it is not known well enough."""
    best = finals[0]
    odds = tip_at_start(best.fit, best.arc, observation.rig, (observation.left_thread, observation.right_thread))
    named = replace(best, arc=place_arc(best.fit, odds >= 0))
    covariance = _edge_on_factor(named.pose) * _covariance(named.fit, named.arc) + _spread(finals)
    pose = named.pose if odds >= 0 else named.pose.swapped()
    probability = float(1.0 / (1.0 + np.exp(-abs(odds))))
    return NeedleEstimate(pose, covariance, probability, _why_abstain(covariance, finals))


def _edge_on_factor(pose: NeedlePose) -> float:
    return 1.0 + EDGE_ON_SCALE * float(np.exp(-((pose.degrees_from_edge_on() / EDGE_ON_ANGLE) ** 2)))


def _spread(finals: list[_Final]) -> np.ndarray:
    """Return what other poses that explain the masks about as well add to the covariance (6, 6) of the best."""
    best = finals[0]
    weights = np.array([np.exp((final.score - best.score) / TEMPERATURE) for final in finals])
    weights /= weights.sum()
    total = np.zeros((6, 6))
    for weight, final in zip(weights[1:], finals[1:], strict=True):
        step, _ = either_way(best.pose, final.pose)
        total += weight * np.outer(step, step)
    return total


def _covariance(fit: CircleFit, arc: Arc) -> np.ndarray:
    """Return the covariance (6, 6) of centre [m] and rotation vector [rad], camera frame, calibration summed out."""
    tiny = np.diag([1.0] * 3 + [1e-4] * 2 + [0.0] * 2)
    marginal = np.linalg.inv(fit.information + tiny)[:5, :5]
    carry = np.zeros((6, 6))
    carry[:3, :3] = np.eye(3)
    carry[3:, 3:] = fit.frame
    local = np.zeros((6, 6))
    local[:5, :5] = marginal
    local[5, 5] = arc.deviation**2
    return carry @ local @ carry.T


def _why_abstain(covariance: np.ndarray, finals: list[_Final]) -> str:
    """Return why the pose should not be used, or nothing."""
    fit, arc = finals[0].fit, finals[0].arc
    if arc.seen.min() < LEAST_SEEN:
        return f"One eye sees {100 * arc.seen.min():.0f} % of the needle on the best circle."
    normal = fit.frame[:, 2]
    in_plane = np.eye(3) - np.outer(normal, normal)
    turn = float(np.sqrt(np.linalg.eigvalsh(in_plane @ covariance[3:, 3:] @ in_plane)[-1]))
    if turn > LARGEST_TURN:
        return f"The needle's plane is known to {np.degrees(turn):.0f} degrees only (edge-on, or too little is seen)."
    shift = float(np.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1]))
    if shift > LARGEST_SHIFT:
        return f"The needle's centre is known to {1000 * shift:.1f} mm only."
    elsewhere = [
        final.score
        for final in finals[1:]
        if _differ(final.fit.frame, final.fit.centre, fit.frame, fit.centre, 10.0, 0.0015)
    ]
    if finals[0].score - max(elsewhere, default=-1e9) < LEAST_LEAD:
        return "Two different poses explain what both eyes see about equally well."
    return ""
