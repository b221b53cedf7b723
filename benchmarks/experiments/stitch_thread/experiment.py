"""The thread's curve in space from true masks and from learned ones, against the true curve.

The start is the true swage. Times are CPU times of one thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence

import cv2
import numpy as np
import torch
from scenewright.stages.suture import (
    CALIBRATION_ERROR,
    THREAD,
    TWO_CAMERAS,
    Segmenter,
    kept_view,
    read_eye,
    reconstruct_thread,
    seen_scene,
)
from scenewright.stages.suture.training.network.views import EYES

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, count
from benchmarks.experiments.stitch_thread.drawing import panel
from benchmarks.experiments.stitch_thread.judging import ThreadRecord, judged
from benchmarks.stitch.kept_views import ViewParameters, views_of

TUNING, SEEDS = range(100), range(3700, 3800)
"""The second were measured before: they are not fresh."""
VIEWS, ALL = "views", "thread_all"
PICTURED = 4


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, ThreadRecord]]:
    """Yield the reconstructions of one view."""
    torch.set_num_threads(1)
    seed = int(trials[0].seed)
    scene, _ = seen_scene(seed, TWO_CAMERAS, calibration_error=CALIBRATION_ERROR)
    eyes = [read_eye(kept_view(views_of(bench), TWO_CAMERAS, seed), eye) for eye in EYES]
    true = [bodies == THREAD for _, bodies in eyes]
    for trial in trials:
        masks = true
        if trial.arm == "learned":
            segmenter = Segmenter.load(bench.parameters.checkpoint)
            masks = [segmenter.masks(picture).thread for picture, _ in eyes]
        started = time.process_time()
        curve = reconstruct_thread(masks[0], masks[1], TWO_CAMERAS, start=scene.pose.swage)
        yield trial, judged(scene, true, curve, time.process_time() - started)


def where(test: Callable[[ThreadRecord], bool]) -> tuple[str, Callable[[ThreadRecord], ThreadRecord | None]]:
    """The views of this kind."""
    return VIEWS, lambda record: record if test(record) else None


def over(
    figure: Callable[[ThreadRecord], float],
    statistic: Callable[[list[float]], float] = np.median,
    *,
    answered: bool = True,
    interval: bool = False,
) -> Measure:
    """Return a statistic over the views (with `answered` those alone that have a curve)."""

    def of(records: Sequence[ThreadRecord]) -> float | None:
        values = [float(figure(record)) for record in records if record.answered or not answered]
        return float(statistic(values)) if values else None

    return Measure(of, interval=interval)


REASONS = {
    "left_over": "not part of the curve",
    "rows": "along the rows",
    "gaps": "bridged along their tangents",
    "crossings": "crossings another way",
    "doubtful_gaps": "gaps another strand",
    "start": "begin at the start",
    "unmatched": "not found in the right eye",
    "cut": "the right eye misses them",
    "vague": "its worst point",
    "leaves": "leaves the picture",
}
"""Why an answer is unsure -> words of the remark that says so."""


def told(words: str) -> Measure:
    """Return the share of the views whose answer says so."""
    return over(lambda r: any(words in remark for remark in r.remarks), np.mean, answered=False)


def pictures(results: Results) -> None:
    """Draw the first views in threads.png."""
    bench, seeds = results.bench, results.seeds(ALL)[:PICTURED]
    segmenter = Segmenter.load(bench.parameters.checkpoint)
    cv2.imwrite(
        str(bench.out / "threads.png"),
        np.hstack([panel(views_of(bench), int(seed), segmenter) for seed in seeds])[..., ::-1],
    )


EXPERIMENT = Experiment(
    name="stitch_thread",
    title="The thread as a curve in space",
    simulated="Pairs of the one rendered world the network was trained on.",
    knows="The needle's true swage as the start; true masks or the network's.",
    does_not_show=(
        "Real thread; the thesis prints no figures to compare with. The start is the true swage, which a "
        "needle with swapped ends would not give. Rendered thread never runs through tissue."
    ),
    arms={"true": "true masks", "learned": "learned masks"},
    cases=(VIEWS,),
    tuning=tuple(map(str, TUNING)),
    reporting=tuple(map(str, SEEDS)),
    together=lambda trial: trial.seed,
    measure=measure,
    record=ThreadRecord,
    subcases={
        ALL: where(lambda record: True),
        "thread_ok": where(lambda record: record.status == "ok"),
        "thread_unsure": where(lambda record: record.status == "unsure"),
        "thread_whole": where(lambda record: record.whole),
        "thread_whole_ok": where(lambda record: record.whole and record.status == "ok"),
        "thread_crossed": where(lambda record: record.crossed),
    },
    measures={
        "views": Measure(count, interval=False),
        "answered": over(lambda r: r.answered, np.mean, answered=False),
        "good": over(lambda r: r.good, np.mean, answered=False, interval=True),
        "distance_mean_mm": over(lambda r: r.distance_mean, interval=True),
        "distance_p95_mm": over(lambda r: r.distance_p95),
        "missed_mean_mm": over(lambda r: r.missed_mean, interval=True),
        "missed_p95_mm": over(lambda r: r.missed_p95),
        "followed": over(lambda r: r.followed, np.mean, answered=False, interval=True),
        "backward": over(lambda r: r.backward, np.mean),
        "inside_2sd": over(lambda r: r.inside_2sd, np.mean),
        "length_error_mm": over(lambda r: abs(r.length - r.true_length)),
        "length_error": over(lambda r: r.length_error),
        "length_within_10_percent": over(lambda r: r.answered and r.length_error <= 0.1, np.mean, answered=False),
        "cpu_seconds": over(lambda r: r.seconds, answered=False),
        **{f"reason_{name}": told(words) for name, words in REASONS.items()},
    },
    parameters=ViewParameters,
    places=frozenset({"views", "checkpoint"}),
    inputs=lambda bench, trial: [bench.parameters.checkpoint],
    pairs=(("learned", "true"),),
    compared=("good", "distance_mean_mm"),
    quick_seeds=4,
    pictures=pictures,
)
