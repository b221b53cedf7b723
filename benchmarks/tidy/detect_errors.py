"""Writes the error model of vision from the log of `benchmarks.tidy.detect`.

python -m benchmarks.tidy.detect --tuning --one --out FOLDER
python -m benchmarks.tidy.detect_errors --runs FOLDER/runs.jsonl --commit HASH --date DATE
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

import numpy as np

from benchmarks.tidy.detect import REPORTING, Look, read_looks
from benchmarks.tidy.detection_score import Match
from stages.tableware.vision.error_model import FILE, ErrorModel, KindErrors
from stages.tableware.world.items import MEASURES, UTENSILS, Kind


def kind_errors(kind: Kind, matches: list[Match], images: int) -> KindErrors:
    """Return the errors of one kind."""
    true = [m for m in matches if m.kind == kind]
    right = [m for m in true if m.right]
    turns = np.abs([m.turn for m in right])
    straight = np.array([m.turn for m in right if abs(m.turn) < np.pi / 2])
    utensil = kind in UTENSILS
    confused = Counter(m.found for m in true if m.found not in (None, kind))
    return KindErrors(
        items=len(true),
        position_sigma=float(np.sqrt(np.mean([m.dx**2 + m.dy**2 for m in right]) / 2.0)),
        yaw_sigma=float(np.sqrt(np.mean(straight**2))) if utensil else 0.0,
        turned_rate=float(np.mean(turns > np.pi / 2)) if utensil else 0.0,
        miss_rate=sum(m.found is None for m in true) / len(true),
        confused_as={other: confused[other] / len(true) for other in MEASURES if confused[other]},
        false_rate=sum(m.kind is None and m.found == kind for m in matches) / images,
    )


def model_of(looks: list[Look], commit: str, date: str) -> ErrorModel:
    """Return the error model of the looks of the arm `ours`."""
    ours = [look for look in looks if look.arm == "ours"]
    matches = [m for look in ours for m in look.matches]
    seeds = sorted({look.seed for look in ours})
    return ErrorModel(
        date=date,
        commit=commit,
        command="python -m benchmarks.tidy.detect --tuning --one",
        seeds="reporting" if seeds[0] >= REPORTING else "tuning",
        images=len(ours),
        conditions=f"seeds {seeds[0]} to {seeds[-1]}, six tiers, three lights, two schemes of colour",
        kinds={kind: kind_errors(kind, matches, len(ours)) for kind in MEASURES},
        unknown_rate=sum(m.found == "unknown" for m in matches) / len(ours),
    )


def main() -> None:
    """Parse the command line and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tidy.detect_errors", description=__doc__)
    parser.add_argument("--runs", type=Path, required=True)
    parser.add_argument("--commit", required=True)
    parser.add_argument("--date", required=True)
    parser.add_argument("--first", type=int, default=60, help="seeds from here: thresholds were set on those before")
    parser.add_argument("--out", type=Path, default=FILE)
    options = parser.parse_args()
    looks = [look for look in read_looks(options.runs) if look.seed >= options.first]
    model_of(looks, options.commit, options.date).write(options.out)


if __name__ == "__main__":
    main()
