"""Fits what actions cost the arm in physics to trials on tuning seeds, and writes data/tableware/physics_times.json.

python -m benchmarks tidy_physics --tuning --out FOLDER
python -m benchmarks.tidy.physics_times --runs FOLDER --date DATE
"""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
from pydantic import Field
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.tableware import ArmTimes
from scenewright.stages.tableware.simulation.arm_times import FILE
from scipy.optimize import nnls

from benchmarks.experiments.tidy_physics import Run, delay_of
from benchmarks.keeping import kept_records
from benchmarks.options import asked

FIRST_REPORTING = 1000


def fit(runs: list[Run]) -> tuple[float, float, float, float]:
    """Return seconds of a trip, a stacking, a pull, and the standard deviation about them, of trials that lost nothing,
    left nothing and met no trouble."""
    good = [run for run in runs if not run.failed and not run.troubles]
    counts = np.array([[run.trips, run.stacks, run.pulls] for run in good], dtype=float)
    seconds = np.array([run.time for run in good])
    found, _ = nnls(counts, seconds)
    residual = float(np.std(seconds - counts @ found))
    return float(found[0]), float(found[1]), float(found[2]), residual


class Options(Parameters):
    """Options of the fit."""

    runs: Path = Field(description="Output folder of tidy_physics")
    date: str = Field(description="When the trials ran")


def main() -> None:
    """Fit and write."""
    options = asked(Options)
    kept = {
        trial: run
        for trial, run in kept_records("tidy_physics", options.runs).items()
        if int(trial.seed) < FIRST_REPORTING and "/truth" in trial.case
        if not delay_of(trial.case)
    }
    trip, stack, pull, residual = fit(list(kept.values()))
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True).stdout
    seeds = sorted(int(trial.seed) for trial in kept)
    tiers, arms = sorted({trial.case.split("/")[0] for trial in kept}), sorted({trial.arm for trial in kept})
    times = ArmTimes(
        trip=round(trip, 3),
        stack=round(stack, 3),
        pull=round(pull, 3),
        residual=round(residual, 3),
        trials=sum(not run.failed and not run.troubles for run in kept.values()),
        date=options.date,
        commit=commit.strip(),
        command="python -m benchmarks tidy_physics --tuning, then benchmarks.tidy.physics_times",
        conditions=f"tuning seeds {seeds[0]} to {seeds[-1]}, {', '.join(tiers)}, arms {', '.join(arms)}",
    )
    times.write(FILE)
    print(FILE)


if __name__ == "__main__":
    main()
