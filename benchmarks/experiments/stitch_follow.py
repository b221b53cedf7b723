"""A moving needle followed by `suture follow`: what a pair takes, and how often its pose is right.

Rendered pairs of an endoscope, the network's masks, or masks of one's own (`own_masks`: the true ones as mask files).
Arm `whole` looks at all of every picture, as a needle is looked for first; the others look where the needle was, and at
all of it when it is lost. Times are processor times of one thread, from the files to the line.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import torch
from scenewright.stages.suture import (
    ENDOSCOPE,
    NEEDLE_RADIUS,
    Follower,
    NeedleEstimate,
    NeedlePose,
    StereoView,
    growing_pairs,
    judged,
    masks_in,
    moved_scene,
    network_masks,
    random_motions,
    render,
    seen_scene,
)
from scenewright.stages.suture.following import name_of

from benchmarks.experiment import Bench, Experiment, Measure, Trial

FRAMES = 8
OWN, WHOLE = "own_masks", "whole"
CALIBRATION_ERROR = 0.15
TUNING, REPORTING = range(20, 40), range(3120, 3130)


@dataclass(frozen=True)
class Line:
    """What was said of one pair. `found`: the needle was known in the pair before."""

    seconds: float
    whole: bool
    found: bool
    answered: bool
    right: bool


Lines = tuple[Line, ...]


def follower_of(arm: str, folder: Path) -> Follower:
    """Return what an arm follows with, ready."""
    own = arm == OWN
    size = (ENDOSCOPE.height, ENDOSCOPE.width)
    make = masks_in(folder / OWN, size, name_of) if own else network_masks(None)
    follower = Follower(ENDOSCOPE, make, NEEDLE_RADIUS, cuts=not own)
    follower.ready()
    return follower


def followed(folder: Path, views: Sequence[StereoView], arm: str) -> Lines:
    """Return what is said of the pairs of a folder; by `whole` each is looked at as if it were the first."""
    follower = follower_of(arm, folder)
    lines: list[Line] = []
    for files, view in zip(growing_pairs(folder, latest=False, idle=0.0), views, strict=True):
        if arm == WHOLE:
            follower = follower_of(arm, folder)
        began = time.process_time()
        line = follower.line(files)
        seconds = time.process_time() - began
        right = False
        if line["camera_from_needle"] is not None:
            pose = NeedlePose(np.array(line["camera_from_needle"]))
            right = judged("ours", "", 0, view, NeedleEstimate(pose, np.array(line["covariance"]), 0.5, "")).within
        found = bool(lines) and lines[-1].answered
        lines.append(Line(seconds, line["whole"], found, line["camera_from_needle"] is not None, right))
    return tuple(lines)


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Lines]]:
    """Render one sequence and follow its needle by every arm."""
    torch.set_num_threads(1)
    scene, _ = seen_scene(int(trials[0].seed), ENDOSCOPE, calibration_error=CALIBRATION_ERROR)
    moved = [moved_scene(scene, motion, index) for index, motion in enumerate(random_motions(scene, FRAMES))]
    views = [render(one) for one in moved]
    with TemporaryDirectory() as place:
        (Path(place) / OWN).mkdir()
        for number, view in enumerate(views):
            for side, eye in (("left", view.left), ("right", view.right)):
                assert eye.image is not None
                cv2.imwrite(str(Path(place) / f"{number:03d}_{side}.png"), eye.image[..., ::-1])
                cv2.imwrite(str(Path(place) / OWN / f"{number:03d}_{side}.png"), eye.bodies)
        for trial in trials:
            yield trial, followed(Path(place), views, trial.arm)


def pairs_of(records: Sequence[Lines]) -> list[Line]:
    """All pairs but the first of each sequence, which is looked at whole by either arm."""
    return [line for lines in records for line in lines[1:]]


def share(name: str) -> Measure:
    """Return the share of pairs."""
    return Measure(lambda records: float(np.mean([getattr(line, name) for line in pairs_of(records)])))


def seconds(which: str) -> Measure:
    """Return the median time of the pairs (`all`), or of those before which the needle was known (`found`)."""

    def of(records: Sequence[Lines]) -> float | None:
        times = [line.seconds for line in pairs_of(records) if which == "all" or line.found]
        return float(np.median(times)) if times else None

    return Measure(of, "s")


def rate(records: Sequence[Lines]) -> float | None:
    """Return how many pairs a second a core follows: pairs before which the needle was known, those looked at whole
    after all among them, over the time of all of them."""
    times = [line.seconds for line in pairs_of(records) if line.found]
    return len(times) / sum(times) if times else None


EXPERIMENT = Experiment(
    name="stitch_follow",
    title="A needle followed from pair to pair",
    simulated=(
        "Needle, thread, drivers and pad before an endoscope, 1280 x 960 pixels; from pair to pair the needle "
        "moves by a few millimetres and degrees."
    ),
    knows="The needle's radius and its taper, which is the renderer's own; most of the calibration; masks are the "
    "network's, or true ones.",
    does_not_show=(
        "Real pictures; a needle that moves far between two pairs; a second needle that appears while the "
        "first is followed. Times are of a busy machine."
    ),
    arms={"ours": "ours", OWN: "masks of one's own", WHOLE: "all of every picture"},
    cases=("endoscope",),
    tuning=tuple(map(str, TUNING)),
    reporting=tuple(map(str, REPORTING)),
    together=lambda trial: trial.seed,
    measure=measure,
    record=Lines,
    measures={
        "pairs_a_second": Measure(rate, "1/s"),
        "seconds_of_known": seconds("found"),
        "seconds": seconds("all"),
        "whole": share("whole"),
        "answered": share("answered"),
        "right": share("right"),
        "pairs": Measure(lambda records: float(len(pairs_of(records))), interval=False),
    },
    quick_seeds=1,
)
