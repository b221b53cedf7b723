"""The needle's pose by the thesis's estimator and by ours on the same seeded views. Times are CPU times."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import cv2
import numpy as np
from scenewright.stages.kit.drawing.plots import STYLE, plt, save
from scenewright.stages.suture import Estimate, draw_eyes, estimate, render, seen_scene
from scenewright.stages.suture.evaluation.needle_figures import MEASURES as FIGURES
from scenewright.stages.suture.evaluation.plots import COLORS

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial
from benchmarks.experiments.stitch_needle.views import CASES, TWO_CAMERAS_NOISE, observe, run

TUNING, SEEDS = range(500), tuple(map(str, range(4200, 4700)))
"""The second were measured before: they are not fresh."""
PICTURED = 4
BOUNDED = ("within_tolerance", "right_guess", "abstained", "wrong_though_answered")


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Estimate]]:
    """Yield every arm's estimate of one view."""
    answers = {answer.arm: answer for answer in run(CASES[trials[0].case], int(trials[0].seed))}
    yield from ((trial, answers[trial.arm]) for trial in trials)


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The views."""
    return (tuple(map(str, TUNING)) if bench.tuning else SEEDS)[: CASES[case].views]


def defined(figure: Callable[[list[Estimate]], float], interval: bool = False) -> Measure:
    """Return a measure of the product's figure, which is below zero where it is undefined."""

    def of(records: Sequence[Estimate]) -> float | None:
        value = figure(list(records))
        return value if value >= 0 else None

    return Measure(of, interval=interval)


MEASURES = {name: defined(figure, name in BOUNDED) for name, figure in FIGURES.items()}


def where(test: Callable[[Estimate], bool]) -> Callable[[Estimate], Estimate | None]:
    """Return what keeps the estimates of some views."""
    return lambda record: record if test(record) else None


def _all(record: Estimate) -> Estimate:
    return record


VISIBLE = where(lambda record: record.visible)
SUBCASES = {
    "needle_visible": ("rendered", VISIBLE),
    "needle_all": ("rendered", _all),
    "needle_visible_geometry": ("geometry", VISIBLE),
    "needle_all_geometry": ("geometry", _all),
    "needle_visible_filtered": ("geometry_filtered", VISIBLE),
    "needle_all_filtered": ("geometry_filtered", _all),
    "needle_miscalibrated": ("geometry_miscalibrated", VISIBLE),
    "needle_corner_left": ("geometry_corner_left", _all),
    "needle_corner_right": ("geometry_corner_right", _all),
    "needle_random": ("geometry", _all),
    **{
        f"needle_visible_{name.removeprefix('geometry_')}": (name, VISIBLE)
        for name in CASES
        if "noise" in name or "ground" in name
    },
    "needle_visible_endoscope": ("geometry_endoscope", VISIBLE),
    "needle_all_endoscope": ("geometry_endoscope", _all),
    **{
        f"visible_geometry_{low}_to_{high}_degrees_from_edge_on": (
            "geometry",
            where(lambda r, low=low, high=high: r.visible and low < r.degrees_from_edge_on <= high),  # type: ignore[misc]
        )
        for low, high in ((0, 15), (15, 30), (30, 60), (60, 90))
    },
}
"""Names without an ending are of the rendered form; `_geometry` and `_endoscope` say the other forms."""


def noise_curve(results: Results) -> None:
    """Draw the share of right poses by the disparity's noise, with its intervals, in noise.png."""
    levels = {TWO_CAMERAS_NOISE: "needle_visible_geometry"}
    levels |= {CASES[case].disparity_noise: name for name, (case, _) in SUBCASES.items() if "noise" in case}
    drawn = sorted((noise, name) for noise, name in levels.items() if name in results.cases)
    if len(drawn) < 2:
        return
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(5.4, 3.2))
        for arm in results.arms():
            found = [(noise, results.interval(arm, name, "within_tolerance")) for noise, name in drawn]
            known = [(noise, at.low, at.value, at.high) for noise, at in found if at is not None]
            noises, low, middle, high = np.array(known).T
            axes.fill_between(noises, low, high, color=COLORS[arm], alpha=0.2, linewidth=0)
            axes.plot(noises, middle, "o-", color=COLORS[arm], label=arm)
        axes.set_xlabel("noise of the disparity [px]")
        axes.set_ylabel("right")
        axes.set_ylim(0.0, 1.0)
        axes.legend(fontsize=8)
        save(figure, results.bench.out / "noise.png")


def pictures(results: Results) -> None:
    """Draw noise.png, and both eyes about the needle in needles.png: truth green, ours yellow (red where it abstained)
    with the tip ringed and the 95 % ellipses of both ends, the mask's outline white."""
    noise_curve(results)
    case, rows = CASES["rendered"], []
    for seed in map(int, results.seeds("needle_all")[:PICTURED]):
        view = render(seen_scene(seed, case.rig, calibration_error=case.calibration_error)[0])
        seen = observe(view, case.disparity_noise, seed)
        assert view.left.image is not None and view.right.image is not None
        eyes, masks = (view.left.image, view.right.image), (seen.left_mask, seen.right_mask)
        rows.append(draw_eyes(eyes, masks, view.rig, estimate(seen), view.pose))
    if rows:
        cv2.imwrite(str(results.bench.out / "needles.png"), np.vstack(rows)[..., ::-1])


EXPERIMENT = Experiment(
    name="stitch_needle",
    title="The needle's pose",
    simulated="Needle, thread, drivers, pad; masks are spoiled true ones, disparity is true with noise.",
    knows="The needle's radius and its taper, which is the renderer's own but in `ground`; most of the calibration.",
    does_not_show=(
        "Real needles: there was no real picture. Masks are spoiled true ones; the network's give less. Other "
        "needles than the known one are placed worse by ours, and a wrong pose may be answered. Weights of "
        "the evidence fit these masks."
    ),
    arms={"thesis": "thesis", "ours": "ours"},
    cases=tuple(CASES),
    tuning=tuple(map(str, TUNING)),
    reporting=SEEDS,
    seeds_of=seeds_of,
    together=lambda trial: (trial.case, trial.seed),
    measure=measure,
    record=Estimate,
    subcases=SUBCASES,
    measures=MEASURES,
    pairs=(("ours", "thesis"),),
    compared=("within_tolerance",),
    quick_seeds=10,
    pictures=pictures,
)
