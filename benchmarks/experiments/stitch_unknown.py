"""What is answered of a needle of which less is known: no radius, one that is off by a fifth, a tip that nobody sees.

The views are pictures of needles by the network's masks; every answer is judged in metres against the truth, whatever
was told. Of a needle whose tip is hidden the picture is filled in over the first sixth of its arc, in both eyes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import cv2
import numpy as np
import torch
from scenewright.stages.suture import (
    ENDOSCOPE,
    NEEDLE_RADIUS,
    TWO_CAMERAS,
    NeedleEstimate,
    NeedleObservation,
    NeedlePose,
    Segmenter,
    StereoView,
    estimate,
    estimate_without_radius,
    judged,
    learned_masks,
    render,
    seen_scene,
)
from scenewright.stages.suture.evaluation.judgement import Estimate
from scenewright.stages.suture.needle.radius import as_if_usual, in_metres
from scenewright.stages.suture.segmentation.checkpoint import BUNDLED
from scipy.stats import chi2

from benchmarks.experiment import Bench, Experiment, Measure, Trial, count, mean, share

TUNING, SEEDS = tuple(map(str, range(300, 400))), tuple(map(str, range(4700, 4800)))
CALIBRATION_ERROR = 0.15
CASE = "pictures"
HIDDEN = np.linspace(0.0, np.pi / 6.0, 40)
"""Angles [rad] of the arc that are filled in where the tip is hidden."""
WIDER = 4
"""Pixels on either side of the wire that are filled in too."""
WITHIN = float(chi2.ppf(0.95, 6))
"""Squared distance by a covariance of six degrees of freedom within which 95 % lie."""


def _told(factor: float) -> Callable[[NeedleObservation], NeedleEstimate]:
    radius = factor * NEEDLE_RADIUS

    def answer(observation: NeedleObservation) -> NeedleEstimate:
        return in_metres(estimate(replace(observation, rig=as_if_usual(observation.rig, radius))), radius)

    return answer


ARMS: dict[str, tuple[str, Callable[[NeedleObservation], NeedleEstimate]]] = {
    "known": ("radius known", estimate),
    "fitted": ("radius fitted", lambda observation: estimate_without_radius(observation)[0]),
    "smaller": ("told a fifth too small", _told(0.8)),
    "larger": ("told a fifth too large", _told(1.2)),
    "tip_hidden": ("tip hidden", estimate),
}


class Unknown(Estimate):
    """What was said, and what it is worth."""

    @property
    def wrong(self) -> bool:
        """Answered, and not within tolerance."""
        return self.answered and not self.right

    @property
    def tip_named(self) -> bool | None:
        """Whether the end that was called the tip is it; None where nothing right was answered."""
        return not self.swapped if self.within else None

    @property
    def said_of_tip(self) -> float | None:
        """The probability that was given to that; None where nothing right was answered."""
        return self.tip_probability if self.within else None

    @property
    def held(self) -> bool | None:
        """Whether the truth lies where 95 % of it should by the covariance; None where nothing was answered."""
        return self.mahalanobis <= WITHIN if self.answered and self.mahalanobis >= 0.0 else None


def tip_filled_in(picture: np.ndarray, line: np.ndarray, width: float) -> np.ndarray:
    """Return a picture (H, W, 3) uint8 filled in by what is around it along a line (N, 2) [px], `width` wide."""
    over = np.zeros(picture.shape[:2], np.uint8)
    cv2.polylines(over, [np.round(line).astype(np.int32)], False, 255, round(width))
    return np.asarray(cv2.inpaint(picture, over, 5, cv2.INPAINT_TELEA))


def without_tip(view: StereoView) -> StereoView:
    """Return a view whose pictures do not show the needle's tip."""
    assert view.left.image is not None and view.right.image is not None
    rig, pose = view.rig, NeedlePose(view.pose.camera_from_needle)
    points = pose.points(HIDDEN)
    width = 2.0 * (0.0005 * rig.focal / float(pose.centre[2]) + WIDER)
    left, right = (
        tip_filled_in(picture, line, width)
        for picture, line in ((view.left.image, rig.left(points)), (view.right.image, rig.right(points)))
    )
    return replace(view, left=replace(view.left, image=left), right=replace(view.right, image=right))


def observed(view: StereoView, segmenter: Segmenter) -> NeedleObservation:
    """Return what the estimators are given of a view with pictures."""
    assert view.left.image is not None and view.right.image is not None
    masks = learned_masks(segmenter.masks(view.left.image), segmenter.masks(view.right.image))
    return masks.observation(view.rig, None, (view.left.image, view.right.image))


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Unknown]]:
    """Estimate the needle of one view by every arm."""
    torch.set_num_threads(1)
    seed, segmenter = int(trials[0].seed), Segmenter.load()
    scene, true = seen_scene(seed, TWO_CAMERAS if seed % 3 else ENDOSCOPE, calibration_error=CALIBRATION_ERROR)
    view = render(scene)
    whole = observed(view, segmenter)
    for trial in trials:
        seen = observed(without_tip(view), segmenter) if trial.arm == "tip_hidden" else whole
        record = judged(trial.arm, CASE, seed, true, ARMS[trial.arm][1](seen))
        yield trial, Unknown(**record.model_dump())


EXPERIMENT = Experiment(
    name="stitch_unknown",
    title="A needle of which less is known",
    simulated="Needle, thread, drivers and pad are rendered; masks are the network's.",
    knows="The rig and the needle's taper; its radius but for the arms that are told another, or none.",
    does_not_show="Needles in real pictures: there are none. A painted-over tip has nothing before it.",
    arms={name: title for name, (title, _) in ARMS.items()},
    cases=(CASE,),
    tuning=TUNING,
    reporting=SEEDS,
    seeds_of=lambda bench, case: TUNING if bench.tuning else SEEDS,
    together=lambda trial: trial.seed,
    measure=measure,
    record=Unknown,
    subcases={CASE: (CASE, lambda record: record), "visible": (CASE, lambda r: r if r.visible else None)},
    measures={
        "views": Measure(count, interval=False),
        "answered": share("answered"),
        "right": share("within"),
        "wrong": share("wrong"),
        "tip_named": share("tip_named"),
        "said_of_tip": mean("said_of_tip"),
        "held": share("held"),
    },
    quick_seeds=4,
    inputs=lambda bench, trial: [BUNDLED],
)
