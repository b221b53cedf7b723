"""Whole suture trials in the simulator: table 4.1 (Srinivas 2024), the thesis's arms and ours.

Reporting seeds begin at 1600: those from 1000 on were run with perception or policies before this. `ours_thesis_eyes`
has our policies and the thesis's error model of perception, `ours_network_eyes` that of ours from the network's masks,
`ours_one_at_a_time` never moves both drivers at once, `thesis_other_test` is the thesis with the other reading of its
handover test; run if asked for are `ours_without_...`, ours without one mechanism, and cases in which one figure of
ours' error model is another.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from pydantic import Field
from scenewright.schemas.suture_trial import SutureRun
from scenewright.stages.kit.measurement.bootstrap import Interval
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.suture import THROWS, Recorder, perception_model, run_of, run_trial
from scenewright.stages.suture.evaluation.trial_figures import KINDS, ratios
from scenewright.stages.suture.evaluation.trial_figures import PAIRS as PAIRS_OF_ARMS

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, count, mean, statistic
from benchmarks.experiments.stitch_trials.arms import ARMS, CHANGES, WITHOUT, eyes_of
from benchmarks.tabulation import Figure, markdown

TUNING, REPORTING = range(200), range(1600, 1800)
CASE = "trials"
PAIRS = (
    ("ours_thesis_eyes", "thesis"),
    ("ours_network_eyes", "thesis"),
    PAIRS_OF_ARMS[0],
    ("ours_one_at_a_time", "thesis"),
    *PAIRS_OF_ARMS[1:],
)
FRAMES = 18
DRAWN = ("sensing_only", "thread_handling", "thesis", "ours_thesis_eyes", "ours_network_eyes", "ours")
"""Arms of the histogram."""
PRINTED_TRIALS = 15
PRINTED_MEASURES = (
    "sutures_to_failure",
    "single_suture_rate",
    "three_throw_rate",
    "full_wound_rate",
    "seconds_per_suture",
    *(f"errors_{kind.lower()}" for kind in KINDS),
)
PRINTED = {
    "sensing_only": (1.40, 0.516, 0.0, 0.0, 106.8, 9, 6, 0, 0),
    "thread_handling": (1.80, 0.559, 0.2, 0.0, 117.9, 6, 5, 2, 2),
    "thesis": (2.93, 0.694, 0.733, 0.0, 159.3, 8, 5, 0, 2),
    "thesis_supervised": (4.47, 0.833, 1.0, 0.2, 141.9, 16, 10, 0, 2),
}
"""Table 4.1 (Srinivas 2024): arm -> PRINTED_MEASURES."""


class TrialsParameters(Parameters):
    """Options of the experiment."""

    perception: Path | None = Field(None, description="An error model for every arm, instead of its own")


class Run(SutureRun):
    """A trial with the CPU time it took."""

    cpu_seconds: float


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Run]]:
    """Yield trials."""
    for trial in trials:
        started = time.process_time()
        seen = perception_model(bench.parameters.perception or eyes_of(trial.arm))
        if trial.case in CHANGES:
            seen = CHANGES[trial.case](seen)
        outcome = run_trial((ARMS | WITHOUT)[trial.arm], int(trial.seed), model=seen)
        spent = time.process_time() - started
        yield trial, Run(**run_of(trial.arm, int(trial.seed), outcome).model_dump(), cpu_seconds=spent)


def over(above: Callable[[Run], float], below: Callable[[Run], float], unit: str = "") -> Measure:
    """Return a sum over another; None where there is nothing to divide by."""

    def of(runs: Sequence[Run]) -> float | None:
        return sum(map(above, runs)) / total if (total := sum(map(below, runs))) else None

    return Measure(of, unit)


def rate(test: Callable[[Run], bool]) -> Measure:
    """Return the share of trials."""
    return over(test, lambda run: 1.0)


def printed(results: Results) -> dict[str, Figure]:
    """What the thesis prints, for the arms that ran."""
    names = [name for name in PRINTED if name in results.arms(CASE)]
    return {
        f"printed {arm}/{CASE}/{measure}": Figure(value, None, None, PRINTED_TRIALS, "")
        for arm in names
        for measure, value in zip(PRINTED_MEASURES, PRINTED[arm], strict=True)
    }


def more_figures(results: Results) -> dict[str, float | Interval | Figure | None]:
    """What is printed; ours over the thesis's arm on the seeds of both: sutures, seconds an attempted throw, seconds a
    completed one."""
    flat: dict[str, float | Interval | Figure | None] = {**printed(results)}
    for ours, rival in PAIRS:
        pairs = dict(enumerate(results.pairs(ours, rival, CASE)))
        found = ratios(ours, {k: a for k, (a, _) in pairs.items()}, {k: b for k, (_, b) in pairs.items()})
        for name in (name for name in found if f"{name}_low" in found):
            flat[name] = Interval(found[name], found[f"{name}_low"], found[f"{name}_high"])
    return flat


def notes(results: Results) -> str:
    """What ended trials."""
    counted: dict[tuple[str, str, str], int] = {}
    for arm in results.arms(CASE):
        for run in results.of(arm, CASE):
            for kind, reason in zip(run.errors, run.reasons, strict=True):
                at = arm, kind, "slack stays in the stitch" if "mm of slack" in reason else reason
                counted[at] = counted.get(at, 0) + 1
    ended = [(*at, str(number)) for at, number in counted.items()]
    return markdown("What ended trials", ("arm", "class", "reason", "count"), ended)


def errors_of(kind: str) -> Measure:
    """Return the number of errors of a kind, over all runs."""
    return Measure(lambda runs: sum(run.errors.count(kind) for run in runs), interval=False)


def pictures(results: Results) -> None:
    """Write the histogram of figure 4.1, the key frames (npz) of a trial of ours and a strip of its first motions."""
    from scenewright.stages.suture import draw_strip
    from scenewright.stages.suture.evaluation.plots import histogram

    if CASE not in results.cases:
        return
    out, recorder = results.bench.out, Recorder()
    histogram(out / "sutures.png", [run for arm in DRAWN for run in results.of(arm, CASE)])
    run_trial(ARMS["ours"], int(results.seeds(CASE)[0]), recorder=recorder)
    recorder.write(out / "frames.npz")
    draw_strip(out / "strip.png", recorder.arrays(), most=FRAMES)


EXPERIMENT = Experiment(
    name="stitch_trials",
    title="Whole suture trials in the simulator",
    simulated="Needle, tissue, thread, two arms; sight is an error model.",
    knows="No truth of the simulator; an arm sees by its error rates, printed or of our renderer.",
    does_not_show="A gain on tissue: everything is simulated. A network's time is in the looks of `ours_network_eyes` "
    "alone.",
    arms={arm: arm for arm in (*ARMS, *WITHOUT)},
    default_arms=lambda bench: tuple(ARMS),
    cases=(CASE, *CHANGES),
    default_cases=lambda bench: (CASE,),
    runs=lambda arm, case: case == CASE or arm == "ours",
    tuning=tuple(map(str, TUNING)),
    reporting=tuple(map(str, REPORTING)),
    measure=measure,
    record=Run,
    measures={
        "sutures_to_failure": mean("sutures"),
        "sutures_to_failure_neutral": mean("sutures_neutral"),
        "single_suture_rate": over(lambda run: run.sutures, lambda run: run.attempts),
        "three_throw_rate": rate(lambda run: run.sutures >= 3),
        "full_wound_rate": rate(lambda run: run.sutures >= THROWS),
        "closed_share": over(lambda run: run.sutures / THROWS, lambda run: 1.0),
        "seconds_per_suture": over(lambda run: run.seconds, lambda run: run.attempts, "s"),
        "seconds_per_completed": over(lambda run: run.seconds, lambda run: run.sutures, "s"),
        "sutures_to_intervention": over(lambda run: run.sutures, lambda run: run.interventions),
        **{f"errors_{kind.lower()}": errors_of(kind) for kind in KINDS},
        "seen_right_share": over(lambda run: run.right, lambda run: run.looks),
        "count": Measure(count, interval=False),
        "cpu_seconds": Measure(statistic("cpu_seconds", sum), "s", interval=False),
    },
    more_figures=more_figures,
    parameters=TrialsParameters,
    places=frozenset({"perception"}),
    inputs=lambda bench, trial: [bench.parameters.perception or eyes_of(trial.arm)],
    quick_seeds=10,
    notes=notes,
    pictures=pictures,
)
