"""The part of the other systems: their own experiments, small, as a checkout declares them, with their rivals."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from benchmarks.board.method import MethodFailed
from benchmarks.board.records import Line, Trial
from benchmarks.board.rooms import Setting

PART = "others"
QUICK_RUN = "--quick"
BESIDE = ("low", "high", "cases")
"""What stands in a file of figures beside a value."""
PRINTED = "printed "
"""How arms begin that are what a thesis prints."""


@dataclass(frozen=True)
class System:
    """One system: which experiment, which of its arms and cases, which figures."""

    experiment: str
    case: str
    """The one that is shown."""
    figures: Sequence[str]
    """Last parts of the figures' names."""
    options: Sequence[str]


SYSTEMS = {
    "told robot": System(
        "come_robot",
        "mixed/fast",
        ("success", "step_success", "recovery"),
        ("--cases", "mixed/fast", "--arms", "open_loop", "thesis", "ours", "--count", "40"),
    ),
    "needles": System(
        "stitch_needle",
        "needle_all_geometry",
        ("within_tolerance", "abstained"),
        ("--cases", "geometry", "--arms", "thesis", "ours", "--count", "40"),
    ),
    "sutures": System(
        "stitch_trials",
        "trials",
        ("sutures_to_failure",),
        ("--cases", "trials", "--arms", "thesis", "ours_thesis_eyes", "ours", "--count", "40"),
    ),
    "packing": System(
        "llm3",
        "hard/unreachable",
        ("success", "motion_planner_calls", "seconds"),
        ("--cases", "hard/unreachable", "--arms", "backtracking_corners", "ours", "--count", "20"),
    ),
    "tables": System(
        "tidy_fast",
        "tier2/fast",
        ("time", "objects_per_trip", "failure_rate"),
        ("--cases", "tier2/fast", "--arms", "stack", "pull", "ours", "--count", "20"),
    ),
    "words learned": System(
        "interpret",
        "set_table/combined",
        ("success", "sentences"),
        ("--cases", "set_table/combined", "--arms", "thesis", "ours"),
    ),
    "cutting": System(
        "cutting", "n2m2", ("iou", "count_exact"), ("--cases", "n2m2", "--arms", "bc", "thesis", "ours", "--count", "6")
    ),
    "splats": System("legs", "rooms/10s", ("psnr",), ("--cases", "rooms/10s", "--arms", "thesis", "ours")),
}


def measure_system(setting: Setting, name: str) -> Iterator[Line]:
    """Yield a line for each arm and case of a system's small run. Raises MethodFailed."""
    system = SYSTEMS[name]
    out = setting.work / PART / name / setting.method.commit
    command = [sys.executable, "-P", "-m", "benchmarks", system.experiment, QUICK_RUN, "--jobs", "1", "--out", str(out)]
    told = {**os.environ, "PYTHONPATH": str(setting.method.checkout)}
    start = os.times()
    done = subprocess.run(
        [*command, *system.options], cwd=setting.method.checkout, env=told, capture_output=True, text=True, check=False
    )
    spent = os.times()
    if done.returncode not in (0, 4):
        said = (done.stderr.strip() or "nothing was said").splitlines()[-1]
        raise MethodFailed(f"benchmarks {system.experiment}", done.returncode, said)
    seconds = spent.children_user + spent.children_system - start.children_user - start.children_system
    by_arm: dict[str, dict[str, float]] = {}
    for key, figure in json.loads((out / "figures.json").read_bytes())["figures"].items():
        arm, *case, measure = key.split("/")
        if measure in system.figures and "/".join(case) == system.case and not arm.startswith(PRINTED):
            values = [(measure, figure["value"]), *((f"{measure} {what}", figure[what]) for what in BESIDE)]
            by_arm.setdefault(arm, {}).update({name: float(value) for name, value in values if value is not None})
    for arm, figures in by_arm.items():
        trial = Trial(part=PART, case=name, seed=system.case.replace("/", ", "), arm=arm)
        yield setting.line(trial, "ours", setting.method, figures=figures, seconds={"all": round(seconds, 1)})
