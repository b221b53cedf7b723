"""Policies that see: before each action the table is rendered and looked at, and what `detect` says is all they know.

    python -m benchmarks.tidy.seen --out FOLDER [--scenes N] [--quick] [--tuning] [--tiers NAME ...]
                                   [--arms NAME ...] [--seconds S]

One trial a table (draw 0 of the world `fast`, where pulls miss and second piles slip; nothing drops by chance), light
levels and colour schemes alternating as for vision. A trial fails by perception when items stay that nobody saw, by
policy when something falls: here a pile that is more than the jaws hold because it was taken for less. Reporting seeds
are 1000 and up, tuning seeds 0 and up. Writes runs.jsonl, metrics.json and table.md; a stopped run goes on.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

from benchmarks.run_log import read_log
from benchmarks.tidy.arms import WORLDS
from benchmarks.tidy.detect import conditions
from benchmarks.tidy.tables import interval
from schemas.base import Model
from stages.tableware.planning.choice import make_policy
from stages.tableware.planning.time_model import fitted
from stages.tableware.sight import Eyes
from stages.tableware.simulation.fast import FastWorld
from stages.tableware.simulation.trial import run_in
from stages.tableware.world.scenes import make_table

ARMS = ("random", "stack", "pull", "ours")
REPORTING, TUNING, LEAST_CONFIDENCE = 1000, 0, 0.3


class SeenRun(Model):
    """One trial."""

    arm: str
    case: str
    seed: int
    time: float
    objects_per_trip: float
    dropped: int
    left: int
    failure: str
    images: int


def trial(tier: str, seed: int, arm: str) -> SeenRun:
    """Return one arm's trial on one table."""
    ((level, scheme),) = conditions(seed, one=True)
    model, chances = fitted(tier), WORLDS["fast"]
    eyes = Eyes(seed, level, scheme, LEAST_CONFIDENCE)
    world = FastWorld(make_table(tier, seed), model, chances, (seed, 0))
    done = run_in(world, make_policy(arm, model, chances, 1000 * seed), eyes)
    return SeenRun(
        arm=arm, case=f"{tier}/fast/seen", seed=seed, time=round(done.seconds, 3),
        objects_per_trip=round(done.objects_per_trip, 4), dropped=done.dropped, left=done.left, failure=done.failure,
        images=eyes.images,
    )  # fmt: skip


def read_seen(path: Path) -> list[SeenRun]:
    """Return the trials of a log, but for a line that was cut off."""
    return read_log(path, SeenRun)


def metrics(runs: list[SeenRun]) -> dict[str, float]:
    """Return `<arm>/<case>/<measure>` -> number."""
    figures: dict[str, float] = {}
    for arm, case in dict.fromkeys((run.arm, run.case) for run in runs):
        group = [run for run in runs if (run.arm, run.case) == (arm, case)]
        at = f"{arm}/{case}"
        for name, values in (
            ("time", np.array([run.time for run in group])),
            ("objects_per_trip", np.array([run.objects_per_trip for run in group])),
        ):
            figures[f"{at}/{name}"] = float(values.mean())
            figures[f"{at}/{name}_low"], figures[f"{at}/{name}_high"] = interval(values)
        figures[f"{at}/trials"] = float(len(group))
        figures[f"{at}/failure_rate"] = float(np.mean([run.failure != "" for run in group]))
        figures[f"{at}/failures_perception"] = float(sum(run.failure == "perception" for run in group))
        figures[f"{at}/failures_policy"] = float(sum(run.failure == "policy" for run in group))
        figures[f"{at}/images"] = float(np.mean([run.images for run in group]))
    return {name: round(value, 5) for name, value in figures.items()}


def table(runs: list[SeenRun]) -> str:
    """Return table.md."""
    figures = metrics(runs)
    lines = [
        "# TIDY, policies that see rendered images",
        "",
        "| tier | arm | trials | seconds | objects per trip | failed by perception | failed by policy | images |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for arm, case in sorted({(run.arm, run.case) for run in runs}, key=lambda pair: (pair[1], ARMS.index(pair[0]))):
        at = f"{arm}/{case}"
        low, high = figures[f"{at}/time_low"], figures[f"{at}/time_high"]
        lines.append(
            f"| {case.split('/')[0]} | `{arm}` | {figures[f'{at}/trials']:.0f} | {figures[f'{at}/time']:.1f} "
            f"[{low:.1f}, {high:.1f}] | {figures[f'{at}/objects_per_trip']:.2f} "
            f"| {figures[f'{at}/failures_perception']:.0f} | {figures[f'{at}/failures_policy']:.0f} "
            f"| {figures[f'{at}/images']:.1f} |"
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tidy.seen", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--scenes", type=int, default=30, help="seeds a tier")
    parser.add_argument("--quick", action="store_true", help="two seeds a tier")
    parser.add_argument("--tuning", action="store_true", help="tuning seeds instead of reporting seeds")
    parser.add_argument("--tiers", nargs="+", default=["tier1", "tier2"])
    parser.add_argument("--arms", nargs="+", default=list(ARMS), choices=list(ARMS))
    parser.add_argument("--seconds", type=float, help="no new trial after so much wall time")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    log = options.out / "runs.jsonl"
    done = {(run.arm, run.case, run.seed) for run in read_seen(log)}
    begun = time.monotonic()
    first = TUNING if options.tuning else REPORTING
    for seed in range(first, first + (2 if options.quick else options.scenes)):
        for tier in options.tiers:
            for arm in options.arms:
                late = options.seconds is not None and time.monotonic() - begun > options.seconds
                if late or (arm, f"{tier}/fast/seen", seed) in done:
                    continue
                with log.open("a", encoding="utf-8") as stream:
                    stream.write(trial(tier, seed, arm).model_dump_json() + "\n")
    runs = read_seen(log)
    (options.out / "metrics.json").write_text(json.dumps(metrics(runs), indent=1, sort_keys=True) + "\n")
    (options.out / "table.md").write_text(table(runs), encoding="utf-8")
    print(options.out / "table.md")


if __name__ == "__main__":
    main()
