"""Fits what actions cost the arm in physics to trials on tuning seeds, and writes data/tableware/physics_times.json.

python -m benchmarks.tidy.physics_times --trials FOLDER/trials.jsonl --date DATE
"""

from __future__ import annotations

import argparse
import subprocess
from pathlib import Path

import numpy as np
from scipy.optimize import nnls

from benchmarks.tidy.physics_records import PhysicsRun, read_runs
from stages.tableware.simulation.arm_times import FILE, ArmTimes

FIRST_REPORTING = 1000


def fit(runs: list[PhysicsRun]) -> tuple[float, float, float, float]:
    """Return seconds of a trip, a stacking, a pull, and the standard deviation about them, of trials that lost nothing,
    left nothing and met no trouble."""
    good = [run for run in runs if not run.failed and not run.troubles]
    counts = np.array([[run.trips, run.stacks, run.pulls] for run in good], dtype=float)
    seconds = np.array([run.time for run in good])
    found, _ = nnls(counts, seconds)
    residual = float(np.std(seconds - counts @ found))
    return float(found[0]), float(found[1]), float(found[2]), residual


def main() -> None:
    """Parse the command line, fit and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tidy.physics_times", description=__doc__)
    parser.add_argument("--trials", type=Path, required=True)
    parser.add_argument("--date", required=True, help="when the trials ran")
    options = parser.parse_args()
    runs = [run for run in read_runs(options.trials) if run.seed < FIRST_REPORTING and run.sight == "truth"]
    trip, stack, pull, residual = fit(runs)
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True).stdout
    seeds = sorted({run.seed for run in runs})
    tiers, arms = sorted({run.tier for run in runs}), sorted({run.arm for run in runs})
    times = ArmTimes(
        trip=round(trip, 3), stack=round(stack, 3), pull=round(pull, 3), residual=round(residual, 3),
        trials=sum(not run.failed and not run.troubles for run in runs), date=options.date, commit=commit.strip(),
        command="python -m benchmarks.tidy.physics --tuning --sight truth, then benchmarks.tidy.physics_times",
        conditions=f"tuning seeds {seeds[0]} to {seeds[-1]}, {', '.join(tiers)}, arms {', '.join(arms)}",
    )  # fmt: skip
    times.write(FILE)
    print(FILE)


if __name__ == "__main__":
    main()
