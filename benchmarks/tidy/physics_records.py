"""Trials in physics as lines of trials.jsonl; their figures of merit and table."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import numpy as np

from benchmarks.run_log import read_log
from schemas.base import Model


class PhysicsRun(Model):
    """What a trial came to. `perception` and `policy`: items dropped or left by whose fault."""

    arm: str
    tier: str
    seed: int
    sight: str
    """image: detections of rendered images; truth: where the bodies are."""
    time: float
    """Simulated seconds."""
    trips: int
    moved: int
    pulls: int
    stacks: int
    dropped: int
    left: int
    actions: int
    perception: int
    policy: int
    troubles: tuple[str, ...]
    cpu_seconds: float

    @property
    def failed(self) -> bool:
        """Whether not everything came to the bin."""
        return self.dropped + self.left > 0

    @property
    def objects_per_trip(self) -> float:
        """Items brought to the bin over trips."""
        return self.moved / max(self.trips, 1)


def read_runs(path: Path) -> list[PhysicsRun]:
    """Return the trials of a log; a line that was cut off at the end is taken out of the file."""
    return read_log(path, PhysicsRun)


def paired(runs: list[PhysicsRun]) -> dict[tuple[str, str], dict[str, list[PhysicsRun]]]:
    """Return (tier, sight) -> arm -> trials on the tables that all arms ran, in the order of seeds."""
    groups: dict[tuple[str, str], dict[str, dict[int, PhysicsRun]]] = defaultdict(lambda: defaultdict(dict))
    for run in runs:
        groups[run.tier, run.sight][run.arm][run.seed] = run
    result = {}
    for key, arms in groups.items():
        seeds = sorted(set.intersection(*(set(rows) for rows in arms.values())))
        result[key] = {arm: [rows[seed] for seed in seeds] for arm, rows in arms.items() if seeds}
    return result


def metrics(runs: list[PhysicsRun]) -> dict[str, float]:
    """Return `<arm>/<tier>/physics[/truth]/<measure>` -> mean over paired tables; `failures_*` are shares of trials."""
    figures: dict[str, float] = {}
    for (tier, sight), arms in paired(runs).items():
        for arm, rows in arms.items():
            at = f"{arm}/{tier}/physics" + ("" if sight == "image" else "/truth")
            figures[f"{at}/trials"] = len(rows)
            figures[f"{at}/time"] = float(np.mean([run.time for run in rows]))
            figures[f"{at}/objects_per_trip"] = float(np.mean([run.objects_per_trip for run in rows]))
            figures[f"{at}/failure_rate"] = float(np.mean([run.failed for run in rows]))
            figures[f"{at}/failures_perception"] = float(np.mean([run.perception > 0 for run in rows]))
            figures[f"{at}/failures_policy"] = float(np.mean([run.policy > 0 for run in rows]))
            figures[f"{at}/items_lost_share"] = float(
                sum(run.dropped + run.left for run in rows) / sum(run.moved + run.dropped + run.left for run in rows)
            )
            figures[f"{at}/cpu_seconds"] = float(np.mean([run.cpu_seconds for run in rows]))
            rival = arms.get("random")
            if rival:
                figures[f"{at}/time_ratio"] = float(
                    np.mean([run.time for run in rival]) / np.mean([run.time for run in rows])
                )
                figures[f"{at}/objects_per_trip_ratio"] = float(
                    np.mean([run.objects_per_trip for run in rows]) / np.mean([run.objects_per_trip for run in rival])
                )
    return {name: round(value, 4) for name, value in figures.items()}


def table(runs: list[PhysicsRun]) -> str:
    """Return table.md."""
    figures = metrics(runs)
    lines = [
        "# TIDY, physics\n",
        "Means over tables that all arms ran. Failed: trials in which something was dropped, tipped over or left.\n",
        "| tier | sight | arm | n | seconds | time ratio | objects per trip | ratio | failed | by perception "
        "| by policy or physics | items lost | CPU s |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for (tier, sight), arms in paired(runs).items():
        for arm in arms:
            at = f"{arm}/{tier}/physics" + ("" if sight == "image" else "/truth")

            def figure(name: str, form: str, at: str = at) -> str:
                return format(figures[f"{at}/{name}"], form) if f"{at}/{name}" in figures else "-"

            lines.append(
                f"| {tier} | {sight} | `{arm}` | {figure('trials', '.0f')} | {figure('time', '.1f')} "
                f"| {figure('time_ratio', '.2f')} | {figure('objects_per_trip', '.2f')} "
                f"| {figure('objects_per_trip_ratio', '.2f')} | {figure('failure_rate', '.1%')} "
                f"| {figure('failures_perception', '.1%')} | {figure('failures_policy', '.1%')} "
                f"| {figure('items_lost_share', '.1%')} | {figure('cpu_seconds', '.1f')} |"
            )
    return "\n".join(lines) + "\n"
