"""Trials in physics as lines of trials.jsonl; their figures of merit and table."""

from __future__ import annotations

from collections import Counter, defaultdict
from pathlib import Path

import numpy as np

from benchmarks.run_log import read_log
from schemas.base import Model
from stages.kit.measurement.bootstrap import bootstrap_interval
from stages.kit.measurement.proportions import wilson_interval

FAR, OURS = "ours_far", "ours"
"""The trials of ours where the bin is far, and ours."""
DELAYS = (0, 3, 5)


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
    looks: int = 0
    perception: int
    policy: int
    troubles: tuple[str, ...]
    losses: tuple[str, ...] = ()
    """Of each item that was lost what it is and in which action, as `fork: take uu`."""
    cpu_seconds: float

    @property
    def failed(self) -> bool:
        """Whether not everything came to the bin."""
        return self.dropped + self.left > 0

    @property
    def objects_per_trip(self) -> float:
        """Items brought to the bin over trips."""
        return self.moved / max(self.trips, 1)

    def seconds(self, delay: float) -> float:
        """Return the trial's time with a bin that is `delay` [s] farther each way."""
        return self.time + 2.0 * delay * self.trips


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
        if seeds:
            result[key] = {arm: [rows[seed] for seed in seeds] for arm, rows in arms.items()}
    return result


def case(tier: str, sight: str, delay: int = 0) -> str:
    """Return the key of a case."""
    return f"{tier}/physics" + ("" if sight == "image" else "/truth") + (f"/delay{delay}" if delay else "")


def metrics(runs: list[PhysicsRun]) -> dict[str, float]:
    """Return `<arm>/<tier>/physics[/truth][/delay<s>]/<measure>` -> mean over paired tables; `failures_*` are shares of
    trials. Delays are added to each trip twice; with them `ours` are the trials planned for a bin 5 s away."""
    figures: dict[str, float] = {}
    for (tier, sight), arms in paired(runs).items():
        for delay in DELAYS:
            shown = dict(arms)
            if delay and FAR in arms:
                shown[OURS] = arms[FAR]
            for arm, rows in shown.items():
                if arm == FAR and OURS in arms:
                    continue
                figures |= _figures(f"{arm}/{case(tier, sight, delay)}", rows, shown, delay)
                if not delay:
                    figures |= _failures(f"{arm}/{case(tier, sight)}", rows)
    return {name: round(value, 4) for name, value in figures.items()}


def _figures(at: str, rows: list[PhysicsRun], arms: dict[str, list[PhysicsRun]], delay: int) -> dict[str, float]:
    times = np.array([run.seconds(delay) for run in rows])
    interval = bootstrap_interval(times, np.random.default_rng(0))
    assert interval is not None  # there is at least one table
    figures = {
        f"{at}/time": float(times.mean()),
        f"{at}/time_low": interval.low,
        f"{at}/time_high": interval.high,
        f"{at}/objects_per_trip": float(np.mean([run.objects_per_trip for run in rows])),
        f"{at}/trials": len(rows),
    }
    rival = arms.get("random")
    if rival:
        figures[f"{at}/time_ratio"] = float(np.mean([run.seconds(delay) for run in rival]) / times.mean())
        figures[f"{at}/objects_per_trip_ratio"] = float(
            figures[f"{at}/objects_per_trip"] / np.mean([run.objects_per_trip for run in rival])
        )
    if "pull" in arms and "stack" in arms:
        better = [min(a.seconds(delay), b.seconds(delay)) for a, b in zip(arms["pull"], arms["stack"], strict=True)]
        figures[f"{at}/no_slower_share"] = float(np.mean(times <= np.array(better) + 1e-6))
    return figures


def _failures(at: str, rows: list[PhysicsRun]) -> dict[str, float]:
    failed, lost = sum(run.failed for run in rows), sum(run.dropped > 0 for run in rows)
    low, high = wilson_interval(failed, len(rows))
    items = sum(run.moved + run.dropped + run.left for run in rows)
    return {
        f"{at}/failure_rate": failed / len(rows),
        f"{at}/failure_rate_low": low,
        f"{at}/failure_rate_high": high,
        f"{at}/lost_rate": lost / len(rows),
        f"{at}/failures_perception": float(np.mean([run.perception > 0 for run in rows])),
        f"{at}/failures_policy": float(np.mean([run.policy > 0 for run in rows])),
        f"{at}/items_lost_share": sum(run.dropped + run.left for run in rows) / items,
        f"{at}/cpu_seconds": float(np.mean([run.cpu_seconds for run in rows])),
    }


def table(runs: list[PhysicsRun]) -> str:
    """Return table.md."""
    figures = metrics(runs)
    groups = paired(runs)
    lines = [
        "# TIDY, physics\n",
        "Means over tables that all arms ran, with 95 % bootstrap intervals. Failed: trials in which something was "
        "dropped, tipped over or left [95 % Wilson]; no slower: share of tables on which the arm took no longer than "
        "the better of Pull and Stack. Ratios against Random.\n",
        "| tier | sight | arm | n | seconds | ratio | objects per trip | ratio | no slower | failed | by perception "
        "| items lost | CPU s |",
        "|---|---|---|--:|---|--:|--:|--:|--:|---|--:|--:|--:|",
    ]
    for (tier, sight), arms in groups.items():
        for arm in arms:
            at = f"{arm}/{case(tier, sight)}"
            if f"{at}/time" not in figures:
                continue

            def figure(name: str, form: str, at: str = at) -> str:
                return format(figures[f"{at}/{name}"], form) if f"{at}/{name}" in figures else "-"

            lines.append(
                f"| {tier} | {sight} | `{arm}` | {figure('trials', '.0f')} | {figure('time', '.1f')} "
                f"[{figure('time_low', '.1f')}, {figure('time_high', '.1f')}] | {figure('time_ratio', '.2f')} "
                f"| {figure('objects_per_trip', '.2f')} | {figure('objects_per_trip_ratio', '.2f')} "
                f"| {figure('no_slower_share', '.0%')} | {figure('failure_rate', '.1%')} "
                f"[{figure('failure_rate_low', '.1%')}, {figure('failure_rate_high', '.1%')}] "
                f"| {figure('failures_perception', '.1%')} | {figure('items_lost_share', '.1%')} "
                f"| {figure('cpu_seconds', '.1f')} |"
            )
    return "\n".join([*lines, "", *_all_tiers(groups), "", *_delays(figures, groups), "", *_causes(groups)]) + "\n"


Groups = dict[tuple[str, str], dict[str, list[PhysicsRun]]]


def _all_tiers(groups: Groups) -> list[str]:
    """Failed trials over all tiers."""
    lines = ["| sight | arm | trials | failed | something lost |", "|---|---|--:|---|---|"]
    for sight in dict.fromkeys(sight for _, sight in groups):
        arms: dict[str, list[PhysicsRun]] = defaultdict(list)
        for (_, other), rows in groups.items():
            for arm, some in rows.items() if other == sight else ():
                arms[arm] += some
        for arm, some in arms.items():
            cells = []
            for count in (sum(run.failed for run in some), sum(run.dropped > 0 for run in some)):
                low, high = wilson_interval(count, len(some))
                cells.append(f"{count}: {count / len(some):.1%} [{low:.1%}, {high:.1%}]")
            lines.append(f"| {sight} | `{arm}` | {len(some)} | {' | '.join(cells)} |")
    return lines


def _delays(figures: dict[str, float], groups: Groups) -> list[str]:
    """Seconds with a bin that is farther."""
    lines = [
        "Seconds with a bin 3 s and 5 s farther (ratio: Random's over these / objects per trip); `ours` planned for it "
        "where `ours_far` ran",
        "",
        "| tier | sight | delay | " + " | ".join(f"`{arm}`" for arm in ("random", "pull", "stack", OURS)) + " |",
        "|---|---|---|---|---|---|---|",
    ]
    for tier, sight in groups:
        for delay in DELAYS[1:]:
            cells = []
            for arm in ("random", "pull", "stack", OURS):
                at = f"{arm}/{case(tier, sight, delay)}"
                if f"{at}/time" not in figures:
                    cells.append("-")
                    continue
                ratio, objects = figures.get(f"{at}/time_ratio", float("nan")), figures[f"{at}/objects_per_trip"]
                cells.append(f"{figures[f'{at}/time']:.1f} ({ratio:.2f} / {objects:.2f})")
            lines.append(f"| {tier} | {sight} | {delay} s | {' | '.join(cells)} |")
    return lines


def _causes(groups: Groups) -> list[str]:
    """What was lost or left, in which actions."""
    lines = ["| sight | arm | what was lost, in which action | items |", "|---|---|---|--:|"]
    for sight in dict.fromkeys(sight for _, sight in groups):
        counts: Counter[tuple[str, str]] = Counter()
        for (tier, other), arms in groups.items():
            for arm, rows in arms.items() if other == sight else ():
                for run in rows:
                    counts.update((arm, loss) for loss in run.losses)
                    counts[arm, f"left on the table ({tier})"] += run.left
        lines += [
            f"| {sight} | `{arm}` | {cause} | {count} |" for (arm, cause), count in sorted(counts.items()) if count
        ]
    return lines
