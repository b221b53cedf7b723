"""Our estimator of the needle's pose from one stereo view, with its covariance, or an abstention."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.stages.suture.needle.estimator import Estimator
from scenewright.stages.suture.needle.evidence import Evidence, evidence_of, left_over
from scenewright.stages.suture.needle.exchanged import eyes_exchanged
from scenewright.stages.suture.needle.filter import difference, either_way, fuse
from scenewright.stages.suture.needle.observation import NeedleEstimate, NeedleObservation
from scenewright.stages.suture.needle.presence import presence_features, presence_probability
from scenewright.stages.suture.needle.silhouette import Outline, Sheet, fit_outline, sheet_of
from scenewright.stages.suture.needle.starts import FARTHEST, NEAREST, starts
from scenewright.stages.suture.needle.windows import EyeMask, needle_masks, windows
from scenewright.stages.suture.rig import NeedlePose, StereoRig

FEWEST_PIXELS = 30
"""Pixels of needle that each eye has to see; by eye."""
STARTS, MIRRORED, FINALISTS = 14, 3, 6
"""Starts that are fitted, the best of them that are also tried mirrored, and outlines that are fitted closely; by
eye."""
NEAR_STARTS, NEAR_FINALISTS = 2, 2
"""The same where a needle that hardly moved is looked for again: starts, and outlines that are fitted closely."""
COARSE_LEVELS, NARROW_LEVELS = ((3.0, 5), (1.5, 3)), ((1.5, 4), (0.7, 8))
"""Widths of the outline [px], and the most steps with each."""
POLISH = 4
"""Most steps of the last fit of an outline; by eye."""
SAMPLED = 90
"""Pixels of each mask on which starts are scored."""
SAME, ALIKE = (0.001, np.radians(15.0)), (0.0003, np.radians(3.0))
"""Two outlines nearer than this [m], [rad] are one, before and after the close fit."""
TOLERANCE = (0.001, np.radians(10.0))
"""What a robot needs of the centre [m] and of the plane [rad] to grasp the needle."""
BASIN = (0.003, np.radians(20.0))
"""Other outlines within this [m], [rad] of the best one are in its covariance; by eye."""
VARIANCE = 0.36
"""Variance of a pixel's misfit, neighbours that err alike counted in; chosen so that ellipsoids hold what they
should."""
LEAST_PROBABILITY = 0.45
"""Probability of being within TOLERANCE, below which the pose is not answered."""
LEAST_PRESENCE = 0.5
"""Probability that there is a needle, below which none is answered: no needle is then the likelier explanation."""
MOST_OF_IT = 0.8
"""Share of the probability that one pose must have about it: what is not known then is where in its neighbourhood the
needle is."""
LEAST_SEEN = 0.1
"""Share of the needle's arc that each eye has to see where it best fits; by eye."""
SECOND_PIXELS, SECOND_SEEN = 150, 0.5
"""A second needle leaves so many pixels of mask in either eye, and each eye sees so much of its arc."""
MOST_SURE = 1.0 - 1e-5
"""Highest probability of which end is the tip: the evidence is no better than that."""
DRAWS = 200
"""Poses drawn from the covariance to tell the chance of being within TOLERANCE; by eye."""


@dataclass(frozen=True)
class Hypothesis:
    """A fitted outline, what speaks for it, and how probable it is among its rivals."""

    outline: Outline
    evidence: Evidence
    probability: float

    @property
    def pose(self) -> NeedlePose:
        """The outline's pose."""
        return self.outline.pose

    def covariance(self) -> np.ndarray:
        """Return the covariance (6, 6) of centre [m] and rotation vector [rad], camera frame; no calibration in it."""
        # what the masks do not determine is known to 100 mm and 3 rad
        tiny = np.diag([1.0 / 0.1**2] * 3 + [1.0 / 3.0**2] * 3 + [0.0] * 2)
        return VARIANCE * np.linalg.inv(self.outline.information + tiny)[:6, :6]


def estimate(
    observation: NeedleObservation, seed: int = 0, guess: NeedlePose | None = None, near: bool = False
) -> NeedleEstimate:
    """Return the needle's pose, covariance and the probability that its tip is the tip; or an abstention.

    `guess`, such as the last frame's pose, is one more start; the answer does not lean on it. `near`: the needle is
    taken to be near the guess, and fewer others are tried beside it. Raises BadInput for a rig or images that cannot
    be.
    """
    observation.check()
    masks = needle_masks(observation)
    counts = [int(mask.sum()) for mask in masks]
    if min(counts) < FEWEST_PIXELS:
        side = "left" if counts[0] <= counts[1] else "right"
        return NeedleEstimate.none(f"The {side} eye sees {min(counts)} pixels of needle; {FEWEST_PIXELS} are needed.")
    swapped = eyes_exchanged(observation.rig, masks)
    if swapped:
        return NeedleEstimate.none(swapped)
    eyes = windows(observation)
    sheets = (sheet_of(eyes[0]), sheet_of(eyes[1]))
    rivals = _hypotheses(observation, eyes, sheets, seed, guess, near)
    if not rivals:
        return NeedleEstimate.none("No circle of the needle's radius passes through what both eyes see.")
    features = presence_features(observation.rig, sheets, rivals[0].outline, observation.pictures)
    answer = _answer(rivals, presence_probability(features), np.random.default_rng(seed))
    answer = replace(answer, presence_features=tuple(features.tolist()))
    if not answer.abstained:
        rest_masks = left_over(observation.rig, eyes, sheets, rivals[0].outline)
        return replace(answer, abstained=_second_needle(observation, rivals[0], rest_masks, seed))
    return answer


def _of_frames(answers: Sequence[NeedleEstimate], motions: Sequence[np.ndarray]) -> NeedleEstimate:
    return fuse(list(zip(answers, motions, strict=True)))


OURS = Estimator("our estimator", estimate, _of_frames)


def hypotheses(observation: NeedleObservation, seed: int = 0, guess: NeedlePose | None = None) -> list[Hypothesis]:
    """Return the outlines that explain both masks best, most probable first; each mask must have a pixel."""
    eyes = windows(observation)
    return _hypotheses(observation, eyes, (sheet_of(eyes[0]), sheet_of(eyes[1])), seed, guess)


def _second_needle(
    observation: NeedleObservation, first: Hypothesis, rest: tuple[np.ndarray, np.ndarray], seed: int
) -> str:
    """Return a sentence if what the first needle leaves of the masks looks like another one."""
    if min(int(mask.sum()) for mask in rest) < SECOND_PIXELS:
        return ""
    alone = replace(observation, left_mask=rest[0], right_mask=rest[1], disparity=None)
    eyes = windows(alone)
    sheets = (sheet_of(eyes[0]), sheet_of(eyes[1]))
    second = next(iter(_hypotheses(alone, eyes, sheets, seed, None)), None)
    if second is None or second.evidence.seen.mean(axis=1).min() < SECOND_SEEN:
        return ""
    if second.evidence.left_over > 0.5 * sum(int(mask.sum()) for mask in rest):
        return ""
    features = presence_features(alone.rig, sheets, second.outline, alone.pictures)
    if alone.pictures is not None and presence_probability(features) < LEAST_PRESENCE:
        return ""
    apart = 1000.0 * float(np.linalg.norm(second.pose.centre - first.pose.centre))
    return f"Two needles are seen, {apart:.0f} mm apart: which one is meant cannot be known."


def _hypotheses(
    observation: NeedleObservation,
    eyes: tuple[EyeMask, EyeMask],
    sheets: tuple[Sheet, Sheet],
    seed: int,
    guess: NeedlePose | None,
    near: bool = False,
) -> list[Hypothesis]:
    rig, random = observation.rig, np.random.default_rng(seed)
    points = _disparity_points(observation, random)
    begun = starts(rig, eyes, points, NEAR_STARTS if near else STARTS, SAMPLED, random)
    if guess is not None:
        begun.insert(0, guess)
    still = np.zeros(2)
    coarse = [fit_outline(rig, sheets, pose, still, COARSE_LEVELS) for pose in begun]
    coarse.sort(key=lambda outline: outline.misfit)
    for outline in coarse[:MIRRORED]:
        coarse.append(fit_outline(rig, sheets, _mirror_in_depth(outline.pose), still, COARSE_LEVELS))
    ordered = [rival.outline for rival in _weigh(rig, eyes, sheets, coarse)]
    return _weigh(rig, eyes, sheets, _fine(rig, sheets, _finalists(ordered, NEAR_FINALISTS if near else FINALISTS)))


def _finalists(coarse: list[Outline], most: int) -> list[Outline]:
    """Return the best few outlines, none of them like another with tip and swage exchanged or not."""
    finalists: list[Outline] = []
    for outline in coarse:
        if NEAREST < outline.pose.centre[2] < FARTHEST and not any(
            _near(either_way(outline.pose, finalist.pose)[0], SAME) for finalist in finalists
        ):
            finalists.append(outline)
        if len(finalists) == most:
            break
    return finalists


def _fine(rig: StereoRig, sheets: tuple[Sheet, Sheet], finalists: list[Outline]) -> list[Outline]:
    """Return every finalist fitted closely, and again with tip and swage exchanged; none like another."""
    outlines: list[Outline] = []
    for finalist in finalists:
        fitted = fit_outline(rig, sheets, finalist.pose, finalist.shift, NARROW_LEVELS, POLISH)
        exchanged = fit_outline(rig, sheets, fitted.pose.swapped(), fitted.shift, NARROW_LEVELS, POLISH)
        for outline in (fitted, exchanged):
            if not any(_near(difference(outline.pose, rival.pose), ALIKE) for rival in outlines):
                outlines.append(outline)
    return outlines


def _weigh(
    rig: StereoRig, eyes: tuple[EyeMask, EyeMask], sheets: tuple[Sheet, Sheet], outlines: list[Outline]
) -> list[Hypothesis]:
    """Return the outlines with their probabilities among each other, most probable first."""
    weighed = [(outline, evidence_of(rig, eyes, sheets, outline)) for outline in outlines]
    if not weighed:
        return []
    logs = np.array([evidence.log_weight for _, evidence in weighed])
    shares = np.exp(logs - logs.max())
    shares /= shares.sum()
    rivals = [Hypothesis(*pair, float(share)) for pair, share in zip(weighed, shares, strict=True)]
    return sorted(rivals, key=lambda hypothesis: -hypothesis.probability)


def _near(step: np.ndarray, limits: tuple[float, float]) -> bool:
    """Whether a step (6,) between poses is within limits [m], [rad]."""
    return bool(np.linalg.norm(step[:3]) < limits[0] and np.linalg.norm(step[3:]) < limits[1])


def _tolerable(steps: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return which (N,) of the steps (N, 6) between poses leave centre and plane (unit `normal`) within TOLERANCE."""
    turns = steps[:, 3:] - (steps[:, 3:] @ normal)[:, None] * normal
    tilts = np.linalg.norm(turns, axis=1)
    return (np.linalg.norm(steps[:, :3], axis=1) < TOLERANCE[0]) & (tilts < TOLERANCE[1])


def _mirror_in_depth(pose: NeedlePose) -> NeedlePose:
    """Return the pose mirrored in depth about its centre: one eye cannot tell them apart, and two near eyes hardly."""
    sight = pose.centre / np.linalg.norm(pose.centre)
    x, y = (axis - 2.0 * (axis @ sight) * sight for axis in pose.camera_from_needle[:3, :2].T)
    matrix = np.eye(4)
    matrix[:3] = np.stack([x, y, np.cross(x, y), pose.centre], axis=1)
    return NeedlePose(matrix)


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


def _answer(rivals: list[Hypothesis], presence: float, random: np.random.Generator) -> NeedleEstimate:
    """Return the pose about which most of the probability lies, with its covariance, or abstain. `presence`: how
    probable it is that the best outline is a needle's."""
    draws = random.standard_normal((DRAWS, 6))
    chances = [_chance(rival, rivals, draws) for rival in rivals]
    chance = max(chances)
    # rivals are ordered: of those about one place the likeliest says where on its circle the needle lies
    best = next(rival for rival, rival_chance in zip(rivals, chances, strict=True) if rival_chance >= 0.9 * chance)
    about = [candidate for candidate in rivals if _about(best.pose, candidate.pose)]
    along = sum(candidate.probability for candidate in about if best.pose.normal @ candidate.pose.normal > 0)
    everything = sum(candidate.probability for candidate in about)
    pose = best.pose if 2.0 * along >= everything else best.pose.swapped()
    sure = max(along, everything - along) / everything
    why = _why_abstain(best, chance, presence, about)
    in_basin = [candidate for candidate in about if _near(either_way(best.pose, candidate.pose)[0], BASIN)]
    covariance = _covariance(best, rivals if why else in_basin)
    return NeedleEstimate(pose, covariance, float(np.clip(sure, 0.5, MOST_SURE)), why)


def _about(pose: NeedlePose, other: NeedlePose) -> bool:
    """Whether two poses have about the same circle, wherever on it the needle lies and which end is the tip."""
    cosine = abs(float(pose.normal @ other.normal))
    return bool(np.linalg.norm(pose.centre - other.centre) < BASIN[0] and cosine > np.cos(BASIN[1]))


def _chance(hypothesis: Hypothesis, rivals: list[Hypothesis], draws: np.ndarray) -> float:
    """Return the probability that the needle is within TOLERANCE of a hypothesis."""
    total = 0.0
    for rival in rivals:
        step, _ = either_way(hypothesis.pose, rival.pose)
        if rival.probability > 0.01 and np.linalg.norm(step[:3]) < 5.0 * TOLERANCE[0]:
            spread = draws @ np.linalg.cholesky(rival.covariance()).T
            total += rival.probability * float(_tolerable(step + spread, hypothesis.pose.normal).mean())
    return total


def _covariance(best: Hypothesis, others: list[Hypothesis]) -> np.ndarray:
    """Return the covariance (6, 6) about the best pose of what `others` (the best among them) say together."""
    total = np.zeros((6, 6))
    for outline in others:
        step, _ = either_way(best.pose, outline.pose)
        total += outline.probability * (outline.covariance() + np.outer(step, step))
    return total / sum(outline.probability for outline in others)


def _why_abstain(best: Hypothesis, chance: float, presence: float, about: list[Hypothesis]) -> str:
    """Return why the pose should not be used, or nothing."""
    if presence < LEAST_PRESENCE:
        return f"What both eyes show is hardly a needle: the best outline is one with {100 * presence:.0f} %."
    least_seen = float(best.evidence.seen.mean(axis=1).min())
    if least_seen < LEAST_SEEN:
        return f"One eye sees {100 * least_seen:.0f} % of the needle where it best fits."
    if chance >= LEAST_PROBABILITY:
        return ""
    if sum(rival.probability for rival in about) < MOST_OF_IT:
        return f"Different poses explain what both eyes see; the likeliest is right with {100 * chance:.0f} %."
    covariance = _covariance(best, about)
    shift = 1000.0 * float(np.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1]))
    turn = np.degrees(float(np.sqrt(np.linalg.eigvalsh(covariance[3:, 3:])[-1])))
    return f"The needle is known to {shift:.1f} mm and {turn:.0f} degrees only (edge-on, or too little is seen)."
