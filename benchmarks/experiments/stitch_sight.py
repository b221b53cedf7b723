"""Suture trials that see by rendered views of the trial itself, beside the same seeds seen by the error model.

`geometry`: masks spoiled as a learned mask's, 15 s of one core a trial; `pictures`: rendered pictures and the network's
masks, 80 s; `error_model` and `network_model` are the error models of either. What became of the looks by place is what
the error model's shares say.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

import cv2
from scenewright.schemas.suture_trial import SutureRun
from scenewright.stages.suture import (
    ARM_NAMES,
    POLICIES,
    Looked,
    LookingEyes,
    PerceptionModel,
    perception_model,
    run_of,
    run_trial,
)
from scenewright.stages.suture.segmentation.checkpoint import BUNDLED
from scenewright.stages.suture.trials.perception import FOLDER

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, count, mean
from benchmarks.experiments.stitch_trials.arms import NETWORK_EYES
from benchmarks.experiments.stitch_trials.experiment import TUNING, over, rate
from benchmarks.stitch.eyes import drawn_looks
from benchmarks.tabulation import markdown

TRIALS = {"geometry": 20, "pictures": 20, "error_model": 20, "network_model": 20}
"""Case -> trials."""
REPORTING = range(1800, 1900)
"""None that any trial threw before: the first of them were looked at after the network's last training."""
BY_NETWORK = ("pictures", "network_model")
FATED = ("geometry", "pictures")
FATES = ("right", "swapped", "abstained", "wrong")


class Look(SutureRun):
    """A trial with what became of the looks (place -> fate -> count), and each look where views were looked at."""

    cpu_seconds: float
    places: dict[str, dict[str, int]] = {}
    looked: tuple[Looked, ...] = ()


def model_of(arm: str, case: str) -> PerceptionModel:
    """Return the error model that an arm sees by; of looks at views, what they are held against."""
    if arm == "ours" and case in BY_NETWORK:
        return perception_model(NETWORK_EYES)
    return perception_model(FOLDER / f"perception_{POLICIES[arm].perception}.toml")


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Look]]:
    """Yield trials."""
    for trial in trials:
        seed, model = int(trial.seed), model_of(trial.arm, trial.case)
        eyes = LookingEyes(model, seed, trial.case == "pictures") if trial.case in FATED else None
        started = time.process_time()
        run = run_of(trial.arm, seed, run_trial(POLICIES[trial.arm], seed, model=model, eyes=eyes))
        spent = time.process_time() - started
        places = {place: dict(counts) for place, counts in eyes.places.items()} if eyes else {}
        looked = tuple(eyes.looked) if eyes else ()
        yield trial, Look(**run.model_dump(), cpu_seconds=spent, places=places, looked=looked)


def looks(results: Results) -> str:
    """Shares of looks by place, beside them those of the error model (a swap of the ends counts there as not right);
    what ended trials."""
    rows, ended = [], []
    for case in (case for case in FATED if case in results.cases):
        for arm in results.arms(case):
            runs, model = results.of(arm, case), model_of(arm, case)
            for place in sorted({place for run in runs for place in run.places}):
                counts = [sum(run.places.get(place, {}).get(fate, 0) for run in runs) for fate in FATES]
                right = model.right_share.at(place)
                told = [count / sum(counts) for count in counts] + [
                    right,
                    (1 - right) * model.abstained_share.at(place),
                ]
                rows.append((case, arm, place, str(sum(counts)), *(f"{100 * share:.1f}" for share in told)))
            ended += [(case, arm, str(r.seed), str(r.sutures), r.errors[-1], r.reasons[-1]) for r in runs if r.errors]
    head = ("case", "arm", "place", "looks", *FATES, "model: right", "model: abstained")
    last = ("case", "arm", "seed", "after", "error", "reason")
    return markdown("Looks [%]", head, rows) + "\n" + markdown("What ended trials", last, ended)


def pictures(results: Results) -> None:
    """Draw the first looks of the first trial that saw pictures in eyes.png."""
    if "pictures" in results.cases:
        cv2.imwrite(str(results.bench.out / "eyes.png"), drawn_looks(int(results.seeds("pictures")[0])))


EXPERIMENT = Experiment(
    name="stitch_sight",
    title="Suture trials that see by rendered views",
    simulated="Needle, tissue, thread, two arms, and in two cases what the cameras see of them.",
    knows="No truth of the simulator.",
    does_not_show="Anything about real pictures. Tail and stitches are not drawn, thread lengths are seen by the error "
    "model, and the disparity is true with noise.",
    arms={arm: arm for arm in ARM_NAMES},
    default_arms=lambda bench: ("ours",),
    cases=tuple(TRIALS),
    default_cases=lambda bench: ("geometry", "error_model"),
    tuning=tuple(map(str, TUNING)),
    reporting=tuple(map(str, REPORTING)),
    seeds_of=lambda bench, case: tuple(map(str, (TUNING if bench.tuning else REPORTING)[: TRIALS[case]])),
    runs=lambda arm, case: arm == "ours" or case != "network_model",
    measure=measure,
    record=Look,
    inputs=lambda bench, trial: [NETWORK_EYES, BUNDLED] if trial.case in BY_NETWORK else [],
    measures={
        "sutures_to_failure": mean("sutures"),
        "seconds_per_suture": over(lambda run: run.seconds, lambda run: run.attempts),
        "full_wound_rate": rate(lambda run: run.sutures >= 6),
        "count": Measure(count, interval=False),
        "cpu_seconds": mean("cpu_seconds", "s", interval=False),
    },
    quick_seeds=2,
    notes=looks,
    pictures=pictures,
)
