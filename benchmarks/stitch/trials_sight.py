"""Trials of `ours` that see by rendered views of the trial itself, beside the same seeds seen by the error model.

    python -m benchmarks.stitch.trials_sight --out FOLDER [--sight geometry|pictures] [--arm ours] [--count N]
        [--first SEED] [--seconds S]

`geometry`: masks spoiled as a learned mask's, 15 s of one core a trial; `pictures`: rendered pictures and the network's
masks, 80 s. Writes looks.jsonl (a stopped run goes on) and table.md: sutures and seconds of both, and what
became of the looks by place, which is what the error model's shares say. `--seconds` stops between two trials.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.run_log import read_log
from benchmarks.stitch.trials import REPORTING
from benchmarks.stitch.trials_records import Run
from stages.kit.measurement.bootstrap import bootstrap_interval
from stages.suture.trials.machine import run_trial
from stages.suture.trials.perception import FOLDER, PerceptionModel, perception_model
from stages.suture.trials.policies import POLICIES
from stages.suture.trials.records import run_of
from stages.suture.trials.sight import SIGHTS, LookingEyes

TRIALS = {"geometry": 30, "pictures": 8}
FATES = ("right", "swapped", "abstained", "wrong")


class Look(Run):
    """A trial seen by rendered views, with what became of the looks (place -> fate -> count), and what the same seed
    came to by the error model."""

    sight: str
    places: dict[str, dict[str, int]]
    model_sutures: int
    model_attempts: int
    model_seconds: float


def one(arm: str, seed: int, sight: str, model: PerceptionModel) -> Look:
    """Run a trial both ways."""
    plain = run_trial(POLICIES[arm], seed, model=model)
    eyes = LookingEyes(model, seed, sight == "pictures")
    started = time.process_time()
    run = run_of(arm, seed, run_trial(POLICIES[arm], seed, model=model, eyes=eyes))
    return Look(
        **run.model_dump(),
        cpu_seconds=round(time.process_time() - started, 1),
        sight=sight,
        places={place: dict(counts) for place, counts in eyes.places.items()},
        model_sutures=plain.sutures,
        model_attempts=plain.attempts,
        model_seconds=round(plain.seconds, 3),
    )


def table(rows: Sequence[Look], model: PerceptionModel) -> str:
    """Return table.md of trials of one arm and one sight."""
    kinds = " ".join(str(sum(row.errors.count(kind) for row in rows)) for kind in "IEHT")
    seen, modelled = (
        bootstrap_interval(np.array(sutures), np.random.default_rng(0))
        for sutures in ([row.sutures for row in rows], [row.model_sutures for row in rows])
    )
    assert seen is not None and modelled is not None  # a table has a row
    lines = [
        f"# {rows[0].arm} that sees by {SIGHTS[rows[0].sight]}\n",
        f"{len(rows)} trials, seeds {min(r.seed for r in rows)} to {max(r.seed for r in rows)}.\n",
        "| seen by | sutures to failure | seconds a suture | I E H T | closed |",
        "|---|---|---|---|---|",
        f"| {rows[0].sight} | {sum(row.sutures for row in rows) / len(rows):.2f} [{seen.low:.2f}, {seen.high:.2f}] "
        f"| {sum(row.seconds for row in rows) / sum(row.attempts for row in rows):.0f} | {kinds} "
        f"| {sum(row.sutures >= 6 for row in rows)} |",
        f"| error model | {sum(row.model_sutures for row in rows) / len(rows):.2f} "
        f"[{modelled.low:.2f}, {modelled.high:.2f}] "
        f"| {sum(row.model_seconds for row in rows) / sum(row.model_attempts for row in rows):.0f} | "
        f"| {sum(row.model_sutures >= 6 for row in rows)} |",
        "",
        "Share of looks [%]; the error model counts a swap of the ends as not right.\n",
        f"| place | looks | {' | '.join(FATES)} | model: right | model: abstained |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for place in sorted({place for row in rows for place in row.places}):
        counts = [sum(row.places.get(place, {}).get(fate, 0) for row in rows) for fate in FATES]
        shares = " | ".join(f"{100 * count / sum(counts):.1f}" for count in counts)
        right = model.right_share.at(place)
        abstained = (1.0 - right) * model.abstained_share.at(place)
        lines.append(f"| {place} | {sum(counts)} | {shares} | {100 * right:.1f} | {100 * abstained:.1f} |")
    ended = [
        f"- seed {row.seed}, after {row.sutures}: {row.errors[-1]}, {row.reasons[-1]}" for row in rows if row.errors
    ]
    return "\n".join([*lines, "", "What ended trials:", "", *(ended or ["- nothing"])]) + "\n"


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stitch.trials_sight", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--sight", default="geometry", choices=list(SIGHTS))
    parser.add_argument("--arm", default="ours", choices=list(POLICIES))
    parser.add_argument("--count", type=int, help="trials; 30 of geometry, 8 of pictures")
    parser.add_argument("--first", type=int, default=REPORTING, help="first seed")
    parser.add_argument("--seconds", type=float, help="stop after this time")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    model = perception_model(FOLDER / f"perception_{POLICIES[options.arm].perception}.toml")
    log = options.out / "looks.jsonl"
    seeds = range(options.first, options.first + (options.count or TRIALS[options.sight]))
    done = {(row.arm, row.seed, row.sight) for row in read_log(log, Look)}
    started = time.monotonic()
    for seed in seeds:
        if options.seconds is not None and time.monotonic() - started > options.seconds:
            break
        if (options.arm, seed, options.sight) not in done:
            row = one(options.arm, seed, options.sight, model)
            with log.open("a", encoding="utf-8") as stream:
                stream.write(row.model_dump_json() + "\n")
    rows = [row for row in read_log(log, Look) if (row.arm, row.sight) == (options.arm, options.sight)]
    if not rows:
        parser.exit(0, "no trial was run\n")
    (options.out / "table.md").write_text(table(rows, model), encoding="utf-8")
    print(options.out / "table.md")


if __name__ == "__main__":
    main()
