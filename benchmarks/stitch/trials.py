"""Suture trials of every arm on the same seeds; a stopped run goes on where it was.

    python -m benchmarks.stitch.trials --out FOLDER [--quick] [--tuning] [--arms NAME ...] [--count N] [--seconds S]
        [--without] [--perception FILE]

Reporting seeds 1400 to 1599 (1000 to 1399 were run with perception or policies before this), tuning seeds (`--tuning`)
0 to 199; `--quick` takes the first ten. Writes runs.jsonl, metrics.json, table.md, sutures.png and, of the first seed,
the key frames and the strip of a suture of an `ours` trial. `--seconds` stops early, between two seeds. Beside the arms
of the issue: `ours_thesis_eyes` has our policies and the thesis's error model of perception, `ours_one_at_a_time` never
moves both drivers at once, `thesis_other_test` is the thesis with the other reading of its handover test; `--without`
takes one mechanism at a time from `ours`; `--perception` lets every arm see by another error model.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from benchmarks.stitch.trials_arms import ARMS, WITHOUT
from benchmarks.stitch.trials_printed import PAIRS, printed_rows
from benchmarks.stitch.trials_records import Run, read_runs
from stages.suture.evaluation.trial_figures import metrics, table
from stages.suture.trials.machine import run_trial
from stages.suture.trials.perception import PerceptionModel, perception_model
from stages.suture.trials.policies import POLICIES
from stages.suture.trials.recording import Recorder
from stages.suture.trials.records import run_of

REPORTING, TUNING, TRIALS, QUICK, FRAMES = 1400, 0, 200, 10, 18


def one(arm: str, seed: int, model: PerceptionModel | None = None) -> Run:
    """Run a trial and return its record; `model` replaces the arm's own."""
    started = time.process_time()
    outcome = run_trial((ARMS | WITHOUT)[arm], seed, model=model)
    spent = round(time.process_time() - started, 3)
    return Run(**run_of(arm, seed, outcome).model_dump(), cpu_seconds=spent)


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stitch.trials", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="ten trials an arm")
    parser.add_argument("--tuning", action="store_true", help="tuning seeds instead of reporting seeds")
    parser.add_argument("--arms", nargs="+", default=list(ARMS), choices=list(ARMS))
    parser.add_argument("--perception", type=Path, help="an error model for every arm, instead of its own")
    parser.add_argument("--without", action="store_true", help="ours, and ours without each of its mechanisms")
    parser.add_argument("--count", type=int, default=TRIALS, help="trials an arm")
    parser.add_argument("--seconds", type=float, help="stop after this time")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    log = options.out / "runs.jsonl"
    first = TUNING if options.tuning else REPORTING
    seeds = range(first, first + (QUICK if options.quick else options.count))
    model = perception_model(options.perception) if options.perception else None
    arms = ["ours", *WITHOUT] if options.without else options.arms
    done = {(run.arm, run.seed) for run in read_runs(log)}
    started = time.monotonic()
    for seed in seeds:
        if options.seconds is not None and time.monotonic() - started > options.seconds:
            break
        rows = [one(arm, seed, model) for arm in arms if (arm, seed) not in done]
        with log.open("a", encoding="utf-8") as stream:
            stream.writelines(run.model_dump_json() + "\n" for run in rows)
    runs = [run for run in read_runs(log) if run.seed in seeds]
    (options.out / "metrics.json").write_text(json.dumps(metrics(runs, PAIRS), indent=1, sort_keys=True) + "\n")
    (options.out / "table.md").write_text(table(runs, PAIRS, printed_rows()), encoding="utf-8")
    pictures(options.out, runs, first)
    print(options.out / "table.md")


def pictures(folder: Path, runs: list[Run], seed: int) -> None:
    """Write the histogram of figure 4.1, the key frames (npz) of one trial and a strip (png) of its first motions."""
    from stages.suture.evaluation.plots import histogram
    from stages.suture.trials.drawing import draw_strip

    histogram(folder / "sutures.png", [run for run in runs if run.arm in POLICIES])
    recorder = Recorder()
    run_trial(ARMS["ours"], seed, recorder=recorder)
    recorder.write(folder / "frames.npz")
    draw_strip(folder / "strip.png", recorder.arrays(), most=FRAMES)


if __name__ == "__main__":
    main()
