"""Writes the error model of vision from what `tidy_detect` measured of ours.

python -m benchmarks tidy_detect --tuning --one --arms ours --out FOLDER
python -m benchmarks.tidy.detect_errors --runs FOLDER --commit HASH --date DATE
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
from pydantic import Field
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.tableware.vision.error_model import FILE, ErrorModel, KindErrors
from scenewright.stages.tableware.world.items import STANDARD, UTENSILS, Kind

from benchmarks.experiments.tidy_detect.experiment import REPORTING
from benchmarks.experiments.tidy_detect.score import Match
from benchmarks.keeping import kept_records
from benchmarks.options import asked


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
        confused_as={other: confused[other] / len(true) for other in STANDARD.kinds if confused[other]},
        false_rate=sum(m.kind is None and m.found == kind for m in matches) / images,
    )


class Options(Parameters):
    """Options of the fit."""

    runs: Path = Field(description="Output folder of tidy_detect")
    commit: str = Field(description="Of what was measured")
    date: str = Field(description="When it was")
    first: int = Field(60, description="Seeds from here: thresholds were set on those before")
    out: Path = Field(FILE, description="File")


def main() -> None:
    """Fit and write."""
    options = asked(Options)
    kept = kept_records("tidy_detect", options.runs).items()
    ours = {int(t.seed): looks for t, looks in kept if t.arm == "ours" and int(t.seed) >= options.first}
    looks = [look for looks in ours.values() for look in looks]
    matches = [match for look in looks for match in look.matches]
    ErrorModel(
        date=options.date,
        commit=options.commit,
        command="python -m benchmarks tidy_detect --tuning --one",
        seeds="reporting" if min(ours) >= REPORTING[0] else "tuning",
        images=len(looks),
        conditions=f"seeds {min(ours)} to {max(ours)}, six tiers, three lights, two schemes of colour",
        kinds={kind: kind_errors(kind, matches, len(looks)) for kind in STANDARD.kinds},
        unknown_rate=sum(m.found == "unknown" for m in matches) / len(looks),
    ).write(options.out)


if __name__ == "__main__":
    main()
