"""What each arm of the needle benchmark is given, and how its answer is judged.

Two forms. `rendered`: both eyes' pictures are rendered in full, thread is found by its violet in the pictures, and the
needle's masks are the true ones with the structured errors of a learned mask. `geometry`: the same scenes and the same
masks without pictures, which is seventy times as fast; thread masks are the true ones with a fifth lost. In both forms
the disparity is the true one with the noise below; drivers are where kinematics with 3 px of error say.
"""

from __future__ import annotations

import time
from dataclasses import astuple, dataclass, replace

import numpy as np
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.suture import (
    ENDOSCOPE,
    TWO_CAMERAS,
    USUAL_NEEDLE,
    Estimate,
    NeedleEstimate,
    NeedleObservation,
    NeedlePose,
    NeedleScene,
    NeedleShape,
    StereoRig,
    StereoView,
    estimate,
    fuse,
    judged,
    motions_to_last,
    moved_scene,
    noisy_disparity,
    random_motions,
    render,
    reported_motion,
    seen_scene,
    spoiled_masks,
    thesis_average,
    thesis_estimate,
)

CALIBRATION_ERROR = 0.15
FRAMES = 10
SEED_OF_MOTION, SEED_OF_SHAPE = 6, 17


@dataclass(frozen=True)
class Case:
    """A set of views: which rig, noise of the disparity [px], calibration error [px], form, and where and by whom the
    needle is held (None: anywhere, anyhow). `frames` above one: a sequence, judged in its last frame."""

    name: str
    views: int
    rig: StereoRig
    disparity_noise: float
    calibration_error: float = CALIBRATION_ERROR
    rendered: bool = False
    holder: str | None = None
    place: str | None = None
    frames: int = 1
    ground: float = 0.0
    """How far the needle is from the one that the estimators know, in the standard deviations of `SPREAD`."""
    alone: str = ""
    """Of PARTS the only one that differs; empty: all do."""


SPREAD = NeedleShape(0.015, 0.06, 0.25, 0.25, 0.015, 0.0002)
"""Standard deviations of how needles differ: radius, wire, taper's angle and power as shares of the usual ones, the
opening as it is, the warp [m]."""
PARTS = {"radius": ("radius",), "taper": ("taper_angle", "taper_power"), "bend": ("opened", "warped")}
"""What of a needle may differ alone."""
TWO_CAMERAS_NOISE, ENDOSCOPE_NOISE = 1.0, 0.65
"""Disparity noise [px]. With the two cameras the thesis's estimator is right in 42 % of 172 visible tuning views; the
endoscope's level is a first guess that has not been measured."""
CASES = {
    case.name: case
    for case in (
        Case("rendered", 40, TWO_CAMERAS, TWO_CAMERAS_NOISE, rendered=True),
        Case("geometry", 200, TWO_CAMERAS, TWO_CAMERAS_NOISE),
        *(Case(f"geometry_noise_{noise:g}", 100, TWO_CAMERAS, noise) for noise in (0.0, 0.25, 0.5, 1.5, 2.0, 3.0)),
        *(Case(f"geometry_ground_{g}", 100, TWO_CAMERAS, TWO_CAMERAS_NOISE, ground=g) for g in (1, 2, 3)),
        *(
            Case(f"geometry_ground_2_{part}", 100, TWO_CAMERAS, TWO_CAMERAS_NOISE, ground=2, alone=part)
            for part in PARTS
        ),
        Case("geometry_miscalibrated", 100, TWO_CAMERAS, TWO_CAMERAS_NOISE, calibration_error=0.3),
        Case("geometry_filtered", 20, TWO_CAMERAS, TWO_CAMERAS_NOISE, frames=FRAMES),
        Case("geometry_corner_left", 100, TWO_CAMERAS, TWO_CAMERAS_NOISE, holder="left", place="corner"),
        Case("geometry_corner_right", 100, TWO_CAMERAS, TWO_CAMERAS_NOISE, holder="right", place="corner"),
        Case("geometry_endoscope", 100, ENDOSCOPE, ENDOSCOPE_NOISE),
    )
}
ARMS = ("thesis", "ours")


def observe(view: StereoView, noise: float, seed: int) -> NeedleObservation:
    """Return what an estimator is given of a view; the picture, where there is one, shows the thread."""
    masks, random = spoiled_masks(view.left, view.right, seed)
    return masks.observation(view.rig, noisy_disparity(view, noise, random))


def drawn_shape(seed: int, ground: float, alone: str = "") -> NeedleShape:
    """Return a needle that differs from the usual one by `ground` times what `SPREAD` says, either way; `alone`: in
    this of PARTS and nothing else, by as much as in all."""
    random = np.random.default_rng([SEED_OF_SHAPE, seed])
    radius, wire, angle, power, opened, warped = (ground * random.normal() * sigma for sigma in astuple(SPREAD))
    usual = USUAL_NEEDLE
    drawn = NeedleShape(
        radius=usual.radius * float(np.exp(radius)),
        wire=usual.wire * float(np.exp(wire)),
        taper_angle=usual.taper_angle * float(np.exp(angle)),
        taper_power=usual.taper_power * float(np.exp(power)),
        opened=opened,
        warped=warped,
    )
    return replace(usual, **{name: getattr(drawn, name) for name in PARTS[alone]}) if alone else drawn


def run(case: Case, seed: int) -> list[Estimate]:
    """Return every arm's estimate of the case's view (or sequence) of `seed`."""
    scene, view = seen_scene(seed, case.rig, case.holder, case.place, case.calibration_error)
    if case.frames > 1:
        return _sequence(case, seed, scene)
    if case.rendered or case.ground:
        scene = replace(scene, shape=drawn_shape(seed, case.ground, case.alone))
        view = render(scene, pictures=case.rendered)
    observation = observe(view, case.disparity_noise, seed)
    results = []
    for arm, function in (("thesis", thesis_estimate), ("ours", estimate)):
        started = time.process_time()
        answer = function(observation)
        results.append(judged(arm, case.name, seed, view, answer, time.process_time() - started))
    return results


def _sequence(case: Case, seed: int, scene: NeedleScene) -> list[Estimate]:
    """Return every arm's estimate in the last of the case's frames. The thesis's are averaged, ours are filtered."""
    random = np.random.default_rng([SEED_OF_MOTION, seed])
    true_motions = random_motions(scene, case.frames)
    answers: dict[str, list[NeedleEstimate]] = {arm: [] for arm in ARMS}
    seconds = dict.fromkeys(ARMS, 0.0)
    reported: list[np.ndarray] = []
    guess: NeedlePose | None = None
    for index, motion in enumerate(true_motions):
        frame = moved_scene(scene, motion, index)
        if index > 0:
            step = motion @ inverse(true_motions[index - 1])
            at = scene.camera_from_world @ step @ inverse(scene.camera_from_world)
            reported.append(reported_motion(at, frame.pose.centre, random))
        view = render(frame, pictures=case.rendered)
        observation = observe(view, case.disparity_noise, frame.seed)
        started = time.process_time()
        answers["thesis"].append(thesis_estimate(observation))
        middle = time.process_time()
        ours = estimate(observation, guess=guess)
        guess = ours.pose if not ours.abstained else None
        answers["ours"].append(ours)
        seconds["thesis"] += middle - started
        seconds["ours"] += time.process_time() - middle
    to_last = motions_to_last(reported)
    fused = {"ours": fuse(list(zip(answers["ours"], to_last, strict=True)))}
    fused["thesis"] = thesis_average(answers["thesis"], to_last)
    return [judged(arm, case.name, seed, view, fused[arm], seconds[arm] / case.frames) for arm in ARMS]
