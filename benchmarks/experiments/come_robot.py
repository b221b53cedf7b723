"""A mobile manipulator told in words: tables 3.2 to 3.4 (Han 2024), ablations, curves over rates of failure."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.stages.agent import (
    ARMS,
    CAUSES,
    TABLE_3_4,
    TASKS,
    THESIS_TASKS,
    Floor,
    Rates,
    Score,
    Setting,
    make_apartment,
    run_trial,
    score,
)

from benchmarks.experiment import Bench, Experiment, Measure, Pooled, Results, Share, Trial, count, mean, pooled
from benchmarks.tabulation import Figure, markdown

TUNING, REPORTING = (*range(1100), *range(2000, 2100), *range(4000, 4100), *range(5000, 5300)), range(5300, 5400)
"""Seeds of TUNING from 1000 on were reported on by earlier versions: they were seen."""
RIVALS = ("open_loop", "bool_feedback", "thesis", "ours", "oracle")
FAST = tuple(f"{task}/fast" for task in TASKS)
MIXED = "mixed/fast"
"""The thesis's eight tasks in turn, for ablations and curves."""
SCALES = (0.5, 2.0, 3.0)
CURVES = {
    f"mixed/{what} x{scale:g}": ((scale, 1.0) if what == "failures" else (1.0, scale))
    for what in ("failures", "perception")
    for scale in SCALES
}
"""Case -> factors of the rates of execution and of perception."""
CURVED = 50
"""Seeds of a case with other rates, for want of processor time."""


@dataclass(frozen=True)
class Record:
    """What one trial came to."""

    success: bool
    false_success: bool
    impossible: bool
    executions: int
    executed: int
    replanned: int
    recovered: int
    calls: int
    seconds: float
    metres: float
    failures: dict[str, tuple[int, int]]
    """Cause -> direct, recovered."""


def seeds_of(bench: Bench, case: str) -> list[str]:
    """The first seeds are enough for curves."""
    most = CURVED if case in CURVES else None
    return [str(seed) for seed in (TUNING if bench.tuning else REPORTING)[:most]]


def runs(arm: str, case: str) -> bool:
    """Ablations run on the mixed case, the curves on two arms."""
    if case in CURVES:
        return arm in ("thesis", "ours")
    return case == MIXED or arm in RIVALS


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Record]]:
    """Yield the arms of one seed of one case, in one apartment with one luck."""
    case, seed = trials[0].case, int(trials[0].seed)
    name = case.split("/")[0]
    task = TASKS[THESIS_TASKS[seed % len(THESIS_TASKS)] if name == "mixed" else name]
    apartment = make_apartment(task, seed)
    rates, floor = Rates().scaled(*CURVES.get(case, (1.0, 1.0))), Floor(apartment)
    for trial in trials:
        setting = Setting(apartment, task.words, task.goals, rates, seed, floor=floor)
        session, world = run_trial(setting, trial.arm)
        yield trial, record_of(score(task.goals, task.impossible, session, world), impossible=bool(task.impossible))


def record_of(made: Score, *, impossible: bool) -> Record:
    """Return what is kept of a judged trial."""
    return Record(
        success=made.success,
        false_success=made.claimed and not made.success,
        impossible=impossible,
        executions=made.executions,
        executed=made.executed,
        replanned=made.replanned,
        recovered=made.recovered,
        calls=made.calls,
        seconds=made.seconds,
        metres=made.metres,
        failures=made.failures,
    )


def share(part: str, whole: str) -> Pooled:
    """Return a figure: pooled counts over pooled counts, in percent."""
    return Pooled(lambda record: (100.0 * getattr(record, part), float(getattr(record, whole))))


def percent(name: str) -> Share:
    """Return a figure: the share of trials of which something is true."""
    return Share(lambda record: (100.0 * getattr(record, name), 1.0), 100.0)


def failed(cause: str, which: int) -> Callable[[Sequence[Record]], float | None]:
    """Return a figure: failures of a cause, direct (0) or recovered (1), all trials together."""
    return lambda records: float(sum(r.failures[cause][which] for r in records))


def more_figures(results: Results) -> Mapping[str, float | Figure | None]:
    """Figures over the groups of tasks that the thesis sums up, and over the impossible ones."""
    groups = {"tabletop": FAST[:4], "mobile": FAST[4:8], "possible": FAST[:10], "impossible": FAST[10:]}
    return of_groups(results, groups, RIVALS)


def of_groups(
    results: Results, groups: Mapping[str, Sequence[str]], arms: Sequence[str]
) -> dict[str, float | Figure | None]:
    """Return figures over all trials of a group of cases, `<arm>/<group>/<measure>`, shares with intervals over
    trials."""
    flat: dict[str, float | Figure | None] = {}
    for group, cases in groups.items():
        for arm in arms:
            records = [record for case in cases for record in results.of(arm, case)]
            for name in ("success", "step_success", "recovery", "false_success") if records else ():
                of = MEASURES[name].of
                assert isinstance(of, Pooled)
                found, value = pooled(of, np.array([of.parts(record) for record in records])), of(records)
                if value is not None:
                    low, high = (found.low, found.high) if found else (None, None)
                    flat[f"{arm}/{group}/{name}"] = Figure(value, low, high, len(records), "%")
            flat[f"{arm}/{group}/trials"] = float(len(records)) if records else None
            for cause in CAUSES if records and group == "possible" else ():
                flat[f"{arm}/{group}/failures_{cause}_direct"] = failed(cause, 0)(records) or 0.0
                flat[f"{arm}/{group}/failures_{cause}_recovered"] = failed(cause, 1)(records) or 0.0
    return flat


def printed(results: Results) -> str:
    """What the thesis prints."""
    rows = [
        ("tabletop, SR", "47.5 (19/40)", "75 (30/40)"),
        ("tabletop, SSR", "71.0 (98/138)", "87.9 (123/140)"),
        ("tabletop, RR", "–", "58.6 (17/29)"),
        ("mobile, SR", "30 (6/20)", "65 (13/20)"),
        ("mobile, SSR", "60.8 (76/125)", "82.8 (101/122)"),
        ("mobile, RR", "–", "60.9 (14/23)"),
    ]
    causes = [(cause, str(direct), str(recovered)) for cause, (direct, recovered) in TABLE_3_4.items()]
    return "\n".join(
        (
            markdown("Tables 3.2 and 3.3 (Han 2024), %", ("as printed", "CaP*", "COME-robot"), rows),
            markdown("Table 3.4", ("as printed", "direct", "recovered"), causes),
        )
    )


MEASURES = {
    "success": Measure(percent("success"), "%"),
    "step_success": Measure(share("executed", "executions"), "%"),
    "recovery": Measure(share("recovered", "replanned"), "%"),
    "false_success": Measure(percent("false_success"), "%"),
    "calls": mean("calls"),
    "seconds": mean("seconds", "s"),
    "metres": mean("metres", "m"),
    **{
        f"failures_{cause}_{kind}": Measure(failed(cause, which), "", interval=False)
        for cause in CAUSES
        for which, kind in enumerate(("direct", "recovered"))
    },
    "trials": Measure(count, interval=False),
}
EXPERIMENT = Experiment(
    name="come_robot",
    title="A mobile manipulator told in words (COME-robot)",
    simulated=(
        "Apartments, cameras, base and arm without contact. Failures come at the rates of the thesis's "
        "failure table, by causes that persist. Brains are rules; no language model is asked."
    ),
    knows="What its cameras and joints tell through one interface; only `oracle` sees without errors.",
    does_not_show=(
        "How often a real robot succeeds, or how good a language model is. Causes and rates of failures are "
        "ours, after a table that does not say what it counts. Every arm has the same brain of rules, which "
        "knows these tasks' words. There is no physics and no picture."
    ),
    arms={arm: arm for arm in ARMS},
    cases=(*FAST, MIXED, *CURVES),
    runs=runs,
    tuning=tuple(map(str, TUNING)),
    reporting=tuple(map(str, REPORTING)),
    seeds_of=seeds_of,
    together=lambda trial: (trial.case, trial.seed),
    measure=measure,
    record=Record,
    measures=MEASURES,
    more_figures=more_figures,
    pairs=(("ours", "thesis"), ("thesis", "bool_feedback"), ("bool_feedback", "open_loop")),
    compared=("success", "recovery"),
    quick_seeds=10,
    steps=(),
    jobs=2,
    notes=printed,
)
