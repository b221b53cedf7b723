"""Whether the needle's estimator says that there is no needle where there is none, and sees it where there is one.

Cases: `empty_pictures`, rendered scenes without a needle, with highlights and blood, by the network's masks;
`empty_masks`, masks made of thread and jaws; `needle_pictures` and `needle_masks`, the same with a needle (every second
picture cluttered, masks spoiled); `endoscope`, recorded frames of tissue without a needle (../shared/data);
`empty_drapes`, rendered cloth, folds, cuts, flaps with shadowed rims, instruments and thread, five over one scene, and
`pairs`, stereo pairs of real pictures at three scales: of these two a needle of each of RADII is asked for, and one
that is answered is one too many. A third of the rendered scenes is an endoscope's.
`python -m benchmarks.training.needle_presence` fits the test on tuning seeds, of which the network saw none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from pydantic import Field
from scenewright.schemas.suture_needle import SutureNeedle
from scenewright.stages.kit.measurement.bootstrap import Interval
from scenewright.stages.kit.measurement.proportions import wilson_interval
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.suture import (
    ENDOSCOPE,
    TWO_CAMERAS,
    NeedleEstimate,
    NeedleObservation,
    Segmenter,
    StereoView,
    cluttered,
    estimate,
    false_masks,
    judged,
    learned_masks,
    render,
    seen_scene,
    spoiled_masks,
)
from scenewright.stages.suture.needle.presence import presence_probability
from scenewright.stages.suture.needle.radius import as_if_usual
from scenewright.stages.suture.segmentation.checkpoint import BUNDLED
from scenewright.stages.suture.world.draping import draped

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, count
from benchmarks.steps import made, opened
from benchmarks.stitch.needleless import needleless_pairs
from benchmarks.tabulation import Figure

TUNING, SEEDS = tuple(map(str, range(300, 400))), tuple(map(str, range(7000, 7500)))
RECORDED = "endoscope"
FRAMES = 10
PAIRS = "pairs"
SCALES, RADII = (0.5, 1.0, 1.6), (0.004, 0.0065, 0.0085, 0.012, 0.016, 0.020)
"""Of the pairs' pixels; of the needles that are asked for [m]."""
VIEWS = {"empty_drapes": 500, "empty_pictures": 100, "empty_masks": 100, "needle_pictures": 100, "needle_masks": 100}
DRAPES_A_SCENE = 5
"""So many seeds are drapes over one rendered scene."""
CALIBRATION_ERROR = 0.15
SEED_OF_CLUTTER, SEED_OF_DRAPES = 91, 92


class AbsentParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data"), description="Folder with surgt_stereo")


@dataclass(frozen=True)
class Sight:
    """What the estimator said of one view. `found`: its best guess is right, `right`: and the answer; `visible`: the
    needle's plane is more than 15 degrees from edge-on; `cluttered`: blood and highlights lie over the picture, the
    needle too; `presence`: the features of the test of presence (empty where no outline came that far)."""

    answered: bool
    found: bool
    right: bool
    visible: bool
    reason: str
    presence: tuple[float, ...] = ()
    cluttered: bool = False


def sight_of(answer: NeedleEstimate, view: StereoView | None = None, cluttered: bool = False) -> Sight:
    """Return the record of one answer; `view` where there is a needle."""
    answered = answer.pose is not None and not answer.abstained
    found = right = visible = False
    if view is not None:
        judgement = judged("ours", "", 0, view, answer)
        found, right, visible = judgement.right, judgement.within, judgement.visible
    return Sight(answered, found, right, visible, answer.abstained, answer.presence_features, cluttered)


def _learned(view: StereoView) -> NeedleObservation:
    segmenter = Segmenter.load()
    assert view.left.image is not None and view.right.image is not None
    masks = learned_masks(segmenter.masks(view.left.image), segmenter.masks(view.right.image))
    return masks.observation(view.rig, None, (view.left.image, view.right.image))


def is_cluttered(case: str, seed: int) -> bool:
    """Whether blood and highlights are painted over a view's pictures."""
    return case in ("empty_pictures", "empty_drapes") or (case == "needle_pictures" and seed % 2 == 1)


def observe(case: str, seed: int) -> tuple[NeedleObservation, StereoView]:
    """Return what the estimator is given of a rendered scene, and the scene's view."""
    torch.set_num_threads(1)
    rig = TWO_CAMERAS if seed % 3 else ENDOSCOPE
    scene, view = seen_scene(seed, rig, calibration_error=CALIBRATION_ERROR)
    random = np.random.default_rng([SEED_OF_CLUTTER, seed])
    if case == "needle_masks":
        return spoiled_masks(view.left, view.right, seed)[0].observation(rig, None), view
    if case == "needle_pictures":
        pictured = render(scene)
        return _learned(cluttered(pictured, random) if is_cluttered(case, seed) else pictured), view
    empty = replace(scene, without_needle=True)
    if case == "empty_drapes":
        undraped = _without_needle(seed - seed % DRAPES_A_SCENE)
        return _learned(draped(undraped, np.random.default_rng([SEED_OF_DRAPES, seed]))), view
    if case == "empty_pictures":
        return _learned(cluttered(render(empty), random)), view
    bare = render(empty, pictures=False)
    left, right = false_masks(bare, random)
    others = spoiled_masks(bare.left, bare.right, seed)[0]
    return replace(others, needle=(left, right)).observation(rig, None), view


@lru_cache(maxsize=1)
def _without_needle(seed: int) -> StereoView:
    """Return a rendered scene without its needle."""
    scene, _ = seen_scene(seed, TWO_CAMERAS if seed % 3 else ENDOSCOPE, calibration_error=CALIBRATION_ERROR)
    return render(replace(scene, without_needle=True))


def together(trial: Trial) -> tuple[str, str]:
    """Trials that are measured together: the recording's, and the drapes over one scene."""
    if trial.case == "empty_drapes":
        return trial.case, str(int(trial.seed) // DRAPES_A_SCENE)
    return trial.case, "" if trial.case == RECORDED else trial.seed


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Sight]]:
    """Estimate one view, or all recorded frames."""
    if trials[0].case == RECORDED:
        sequence = made("ingest", bench.out / "recorded", "--log", bench.parameters.data / "surgt_stereo")
        needle = opened(SutureNeedle, made("suture needle", bench.out / "needles", "--sequence", sequence))
        for trial in trials:
            said = needle.info.frames[int(trial.seed)].estimate
            yield trial, Sight(not said.abstained, False, False, False, said.abstained)
        return
    if trials[0].case == PAIRS:
        yield trials[0], any_radius(_real_observation(bench, trials[0].seed))
        return
    for trial in trials:
        seed = int(trial.seed)
        observation, view = observe(trial.case, seed)
        if trial.case == "empty_drapes":
            yield trial, any_radius(observation)
            continue
        truth = view if trial.case.startswith("needle") else None
        yield trial, sight_of(estimate(observation), truth, is_cluttered(trial.case, seed))


def any_radius(observation: NeedleObservation) -> Sight:
    """Return what is said of a view without a needle by the radius of RADII that is answered, or comes nearest."""
    answers = [estimate(replace(observation, rig=as_if_usual(observation.rig, radius))) for radius in RADII]
    return max(map(sight_of, answers), key=_temptation)


def _temptation(sight: Sight) -> tuple[bool, float]:
    return sight.answered, presence_probability(np.array(sight.presence)) if sight.presence else -1.0


def _real_observation(bench: Bench, name: str) -> NeedleObservation:
    torch.set_num_threads(1)
    of_pair, scale = name.split("@")
    pair = needleless_pairs(bench.parameters.data, bench.out)[of_pair.replace("_", " ")]().scaled(float(scale))
    segmenter = Segmenter.load()
    masks = learned_masks(segmenter.masks(pair.left), segmenter.masks(pair.right))
    return masks.observation(pair.rig, None, (pair.left, pair.right))


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """Views, or frames where the recording is there; nothing is tuned on it."""
    if case == PAIRS:
        names = [] if bench.tuning else list(needleless_pairs(bench.parameters.data, bench.out))
        return tuple(f"{name.replace(' ', '_')}@{scale}" for name in names for scale in SCALES)
    if case != RECORDED:
        return (TUNING if bench.tuning else SEEDS)[: VIEWS[case]]
    there = not bench.tuning and (bench.parameters.data / "surgt_stereo").is_dir()
    return tuple(map(str, range(FRAMES))) if there else ()


def _visible(record: Sight) -> Sight | None:
    return record if record.visible else None


def _all(record: Sight) -> Sight:
    return record


def _visible_where(cluttered: bool) -> Callable[[Sight], Sight | None]:
    return lambda record: record if record.visible and record.cluttered == cluttered else None


SUBCASES: dict[str, tuple[str, Callable[[Sight], Sight | None]]] = {
    **{case: (case, _all) for case in (*VIEWS, RECORDED, PAIRS)},
    **{f"{case}_visible": (case, _visible) for case in VIEWS if case.startswith("needle")},
    "needle_pictures_visible_plain": ("needle_pictures", _visible_where(False)),
    "needle_pictures_visible_cluttered": ("needle_pictures", _visible_where(True)),
}


def shares(results: Results) -> dict[str, float | Interval | Figure | None]:
    """The shares with Wilson's intervals: of five hundred views without a false needle a bootstrap says nothing."""
    flat: dict[str, float | Interval | Figure | None] = {}
    for case in results.cases:
        records = results.of("ours", case)
        for name in ("answered", "right"):
            there = sum(getattr(record, name) for record in records)
            low, high = wilson_interval(there, len(records))
            share = 100 * there / len(records)
            flat[f"ours/{case}/{name}"] = Figure(share, 100 * low, 100 * high, len(records), "%")
    return flat


EXPERIMENT = Experiment(
    name="stitch_absent",
    title="A needle, or none",
    simulated="Needle, thread, drivers, pad, highlights and blood are rendered; masks are the network's, or made of "
    "what is no needle; `endoscope` is recorded, and so are `pairs`, but for the right eye of tables and rooms.",
    knows="The needle's radius; the rig; no disparity is given.",
    does_not_show=(
        "Needles in real pictures: there are none. Highlights, blood, cloth and instruments are rendered in "
        "the world in which network and test of presence were tuned; five pictures show one scene. Of real "
        "wounds there is one recording. The aims (no drape answered, nine of ten visible needles answered) "
        "are missed."
    ),
    arms={"ours": "ours"},
    cases=(*VIEWS, RECORDED, PAIRS),
    seeds_of=seeds_of,
    together=together,
    measure=measure,
    record=Sight,
    subcases=SUBCASES,
    measures={"views": Measure(count, interval=False)},
    more_figures=shares,
    quick_seeds=10,
    parameters=AbsentParameters,
    places=frozenset({"data"}),
    inputs=lambda bench, trial: [BUNDLED],
    steps=("ingest", "suture needle"),
)
