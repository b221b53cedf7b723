"""What an experiment declares: arms x cases x seeds, a function that measures trials, and how records become figures.

An experiment is `benchmarks/experiments/<name>.py`, or `<name>/experiment.py` there where it needs more files, with an
`EXPERIMENT`; it is found by that place. `python -m benchmarks NAME` does the rest: which trials are wanted, which of
them are kept already, processes, intervals, metrics.json, figures.json, table.md, pictures.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from scenewright.stages.kit.measurement.bootstrap import (
    Interval,
    bootstrap_interval,
    figure_interval,
    paired_interval,
    pooled_interval,
)
from scenewright.stages.kit.measurement.proportions import wilson_interval
from scenewright.stages.kit.stage import Parameters

from benchmarks.board.statistics import LEAST_ROOMS, over_rooms
from benchmarks.tabulation import Figure

RESAMPLES = 2000
SEED_OF_INTERVALS = 0
LEAST_CLUSTERS = LEAST_ROOMS
"""With fewer there is no interval: of three clusters a bootstrap's 95 % are 73 %."""
MANY_CLUSTERS = 20
"""From so many on the percentile bootstrap is used for means and shares too; of fewer it is too narrow."""


@dataclass(frozen=True, order=True)
class Trial:
    """One arm on one seed of one case. `seed` names what is drawn or looked at: a room, a frame, a number."""

    arm: str
    case: str
    seed: str

    def __str__(self) -> str:
        return f"{self.arm}/{self.case}/{self.seed}"


@dataclass(frozen=True)
class Bench:
    """What a run was asked for, and where it keeps things."""

    out: Path
    parameters: Any
    """The experiment's own options, of its class `parameters`."""
    quick: bool = False
    tuning: bool = False
    """The tuning seeds instead of those for reporting."""

    def folder(self, trial: Trial) -> Path:
        """Folder of a trial: its record, and the files that `measure` leaves beside it."""
        parts = (*trial.case.split("/"), trial.seed)
        return Path(self.out, "trials", quote(trial.arm, safe=" +"), *(quote(part, safe=" +") for part in parts))


@dataclass(frozen=True)
class Measure:
    """A figure over the records of an arm's seeds in a case: pooled counts, a mean, a median; None if undefined."""

    of: Callable[[Sequence[Any]], float | None]
    unit: str = ""
    interval: bool = True
    """False for what resampling says nothing about: counts, and what is dear to compute."""


@dataclass(frozen=True)
class Pooled:
    """A figure that is a sum over a sum: intervals resample what each record adds, in one array."""

    parts: Callable[[Any], tuple[float, float]]
    """Of a record: what it adds above and below the line."""

    def sums(self, records: Sequence[Any]) -> tuple[float, float]:
        """Return the sums above and below the line."""
        parts = [self.parts(record) for record in records]
        return float(sum(above for above, _ in parts)), float(sum(below for _, below in parts))

    def __call__(self, records: Sequence[Any]) -> float | None:
        """Return the figure; None with nothing below the line."""
        above, below = self.sums(records)
        return above / below if below else None


@dataclass(frozen=True)
class Share(Pooled):
    """How many of all tries: each record adds `whole` or 0 to what is above the line, and 1 or 0 below it."""

    whole: float = 1.0


def pooled(of: Pooled, parts: np.ndarray, other: np.ndarray | None = None) -> Interval | None:
    """Return a pooled figure of clusters (N, 2), or that less the same of `other`, with its 95 % interval; None with
    fewer than five clusters that have anything below the line, and for an interval without width.

    Wilson's (1927) for a share of which each cluster is one try; Student's t over the clusters (of a ratio over their
    deviations from it, by the delta method) with fewer than twenty; from twenty on percentile bootstrap over clusters.
    """
    own = [parts] if other is None else [parts, other]
    defined = np.all([rows[:, 1] != 0 for rows in own], axis=0)
    count = int(defined.sum())
    if count < LEAST_CLUSTERS:
        return None
    share = isinstance(of, Share) and other is None
    whole = of.whole if isinstance(of, Share) and share else 1.0
    if share and not (parts[:, 1] > 1).any():
        successes = round(parts[:, 0].sum() / whole)
        low, high = wilson_interval(successes, count)
        return Interval(whole * successes / count, whole * low, whole * high)
    if count >= MANY_CLUSTERS:
        return pooled_interval(parts, other, np.random.default_rng(SEED_OF_INTERVALS), resamples=RESAMPLES)
    values = [_around_their_ratio(rows[defined]) for rows in own]
    told = values[0] - values[1] if len(values) > 1 else values[0]
    spread = over_rooms([float(value) for value in told / whole], share=share)
    if spread is None or spread.low is None or spread.high is None:
        return None
    return Interval(whole * spread.mean, whole * spread.low, whole * spread.high)


def _around_their_ratio(parts: np.ndarray) -> np.ndarray:
    """Return a value for each cluster, whose mean is the sum over the sum and whose spread is the ratio's."""
    ratio_of_sums = parts[:, 0].sum() / parts[:, 1].sum()
    return ratio_of_sums + (parts[:, 0] - ratio_of_sums * parts[:, 1]) / parts[:, 1].mean()


Measuring = Callable[[Bench, Sequence[Trial]], Iterable[tuple[Trial, Any]]]


def _itself(trial: Trial) -> Hashable:
    return trial


def _everywhere(arm: str, case: str) -> bool:
    return True


@dataclass(frozen=True)
class Experiment:
    """One experiment. `measure` and everything that it reaches is what a kept record was measured with."""

    name: str
    title: str
    simulated: str
    """What of it was simulated."""
    knows: str
    """What the methods were allowed to know."""
    does_not_show: str
    arms: Mapping[str, str]
    """Name -> title, in the order of the tables."""
    cases: Sequence[str]
    measure: Measuring
    """Yield (trial, record) for each of the trials given, which share work (`together`), as soon as it is measured."""
    record: Any
    """Type of a record: a dataclass or pydantic model of plain values, or dict[str, float]."""
    measures: Mapping[str, Measure]
    """Name in metrics.json -> figure."""
    tuning: Sequence[str] = ()
    """Seeds that were looked at while methods and constants were chosen; `--tuning` runs these."""
    reporting: Sequence[str] = ()
    """Seeds that figures are of, measured once or more: only the sealed rooms of benchmarks/board are fresh."""
    seeds_of: Callable[[Bench, str], Sequence[str]] | None = None
    """(bench, case) -> seeds, where they depend on the case or on data that may not be there; none leaves it out."""
    default_cases: Callable[[Bench], Sequence[str]] | None = None
    """The cases without `--cases`, where not all of them run everywhere."""
    default_arms: Callable[[Bench], Sequence[str]] | None = None
    runs: Callable[[str, str], bool] = _everywhere
    """(arm, case) -> whether the arm runs in the case."""
    together: Callable[[Trial], Hashable] = _itself
    """Trials of one value are measured by one call."""
    cluster: Callable[[str], str] = str
    """Seed -> what intervals resample: trials of one room are drawn together."""
    parameters: type[Parameters] = Parameters
    places: frozenset[str] = frozenset()
    """Parameters that only say where things are, and are in no key."""
    quick_seeds: int | None = None
    """So many seeds a case with `--quick`."""
    quick: Mapping[str, Any] = field(default_factory=dict)
    """Parameters with `--quick`, unless they are given."""
    keeps: bool = True
    """False where the steps that `measure` runs keep everything themselves, and others read their artifacts."""
    jobs: int = 1
    """Calls of `measure` at a time without `--jobs`; more than one only where no arm is timed by the wall."""
    prepare: Callable[[Bench, Sequence[Trial]], None] | None = None
    """Once before trials run beside each other: what all of them share."""
    inputs: Callable[[Bench, Trial], Sequence[Path]] | None = None
    """Files and folders whose content a trial depends on; artifacts count by their manifest's digest."""
    steps: Sequence[str] = ()
    """Commands whose code counts: those that `measure` runs, and those whose parts are found by their place."""
    code: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Arm -> modules that it runs, where it is not all that `measure` reaches."""
    pairs: Sequence[tuple[str, str]] = ()
    """(first, second): arms whose difference on the same seeds is told."""
    compared: Sequence[str] = ()
    """Measures of the differences."""
    subcases: Mapping[str, tuple[str, Callable[[Any], Any | None]]] = field(default_factory=dict)
    """A case that is shown -> the case that is measured for it, and what of a record counts there (None: nothing). With
    any of them they are all that is shown."""
    more_figures: Callable[[Results], Mapping[str, float | Interval | Figure | None]] | None = None
    """Further `<arm>/<case>/<measure>` -> value; as a `Figure` where how many cases it is of is known."""
    notes: Callable[[Results], str] | None = None
    """What table.md says after the figures, the differences and the single seeds."""
    pictures: Callable[[Results], None] | None = None
    """Draws and writes into the output folder what table.md does not hold."""
    problems: Callable[[Results], Sequence[str]] | None = None
    """What was expected and does not hold, in words; any makes the command exit with 4."""


@dataclass
class Results:
    """The records of a run."""

    experiment: Experiment
    bench: Bench
    records: Mapping[Trial, Any]
    _clusters: dict[tuple[str, str], dict[str, list[Any]]] = field(default_factory=dict)
    _values: dict[tuple[str, ...], dict[tuple[int, ...], float | None]] = field(default_factory=dict)

    @property
    def cases(self) -> list[str]:
        """The cases that ran, in their order."""
        return list(dict.fromkeys(trial.case for trial in self.records))

    def arms(self, case: str | None = None) -> list[str]:
        """The arms that ran (in a case), in the order of the declaration."""
        there = {trial.arm for trial in self.records if case in (None, trial.case)}
        return [arm for arm in self.experiment.arms if arm in there]

    def seeds(self, case: str) -> list[str]:
        """The seeds of a case that any arm ran on."""
        return list(dict.fromkeys(trial.seed for trial in self.records if trial.case == case))

    def of(self, arm: str, case: str) -> list[Any]:
        """The records of an arm in a case, by seed."""
        return [record for group in self._grouped(arm, case).values() for record in group]

    def get(self, arm: str, case: str, seed: str) -> Any | None:
        """The record of one trial."""
        return self.records.get(Trial(arm, case, seed))

    def pairs(self, first: str, second: str, case: str) -> list[tuple[Any, Any]]:
        """The records of two arms on the seeds that both ran."""
        found = ((self.get(first, case, seed), self.get(second, case, seed)) for seed in self.seeds(case))
        return [(a, b) for a, b in found if a is not None and b is not None]

    def value(self, arm: str, case: str, measure: str) -> float | None:
        """A measure of an arm in a case."""
        records = self.of(arm, case)
        return self.experiment.measures[measure].of(records) if records else None

    def interval(self, arm: str, case: str, measure: str) -> Interval | None:
        """A measure with its 95 % interval over clusters of seeds, as `pooled` says of means, shares and
        sums over sums, by percentile bootstrap of others; None where it is undefined or of fewer than five clusters."""
        names = list(self._grouped(arm, case))
        if len(names) < LEAST_CLUSTERS:
            return None
        of, parts = self.experiment.measures[measure].of, self._parts(arm, case, measure, names)
        if parts is not None:
            assert isinstance(of, Pooled)
            return pooled(of, parts)
        random = np.random.default_rng(SEED_OF_INTERVALS)
        return figure_interval(self._figure(arm, case, measure, names), range(len(names)), random, resamples=RESAMPLES)

    def difference(self, first: str, second: str, case: str, measure: str) -> Interval | None:
        """`first` minus `second` over the clusters that both ran on, drawn together, with its 95 % interval,
        as of `interval`."""
        other = self._grouped(second, case)
        names = [name for name in self._grouped(first, case) if name in other]
        if len(names) < LEAST_CLUSTERS:
            return None
        parts, others = (self._parts(arm, case, measure, names) for arm in (first, second))
        if parts is not None and others is not None:
            of = self.experiment.measures[measure].of
            assert isinstance(of, Pooled)
            return pooled(of, parts, others)
        figures = [self._figure(arm, case, measure, names) for arm in (first, second)]
        numbers = [(which, k) for which in (0, 1) for k in range(len(names))]

        def of_either(samples: Sequence[tuple[int, int]]) -> float | None:
            return figures[samples[0][0]]([k for _, k in samples])

        half = len(names)
        random = np.random.default_rng(SEED_OF_INTERVALS)
        return paired_interval(of_either, numbers[:half], numbers[half:], random, resamples=RESAMPLES)

    def _grouped(self, arm: str, case: str) -> dict[str, list[Any]]:
        if (arm, case) not in self._clusters:
            groups: dict[str, list[Any]] = {}
            for trial, record in self.records.items():
                if (trial.arm, trial.case) == (arm, case):
                    groups.setdefault(self.experiment.cluster(trial.seed), []).append(record)
            self._clusters[arm, case] = groups
        return self._clusters[arm, case]

    def _parts(self, arm: str, case: str, measure: str, names: Sequence[str]) -> np.ndarray | None:
        """What each cluster adds above and below the line (N, 2), where the measure is pooled."""
        of, groups = self.experiment.measures[measure].of, self._grouped(arm, case)
        return np.array([of.sums(groups[name]) for name in names]) if isinstance(of, Pooled) else None

    def _figure(
        self, arm: str, case: str, measure: str, names: Sequence[str]
    ) -> Callable[[Sequence[int]], float | None]:
        """The measure over clusters given by their numbers; remembered by how often each is drawn."""
        groups, of = self._grouped(arm, case), self.experiment.measures[measure].of
        values = self._values.setdefault((arm, case, measure, *names), {})

        def figure(numbers: Sequence[int]) -> float | None:
            drawn = tuple(sorted(numbers))
            if drawn not in values:
                values[drawn] = of([record for k in drawn for record in groups[names[k]]])
            return values[drawn]

        return figure


def shown(experiment: Experiment, records: Mapping[Trial, Any]) -> dict[Trial, Any]:
    """Return the records by the cases that are shown."""
    if not experiment.subcases:
        return dict(records)
    parts = {
        Trial(trial.arm, name, trial.seed): part(record)
        for name, (case, part) in experiment.subcases.items()
        for trial, record in records.items()
        if trial.case == case
    }
    return {trial: record for trial, record in parts.items() if record is not None}


def ratio(pairs: Sequence[tuple[float, float]], of: Callable[..., Any] = np.mean) -> Figure | None:
    """Return the mean (or what else `of` is, as np.median) of the firsts over that of the seconds, with its 95 %
    interval over pairs: as `pooled` says of means, by percentile bootstrap of others, none of fewer than five. None
    without any pair."""
    if not pairs:
        return None
    values = np.array(pairs, dtype=float)

    def over(drawn: np.ndarray, axis: int) -> np.ndarray:
        parts = of(drawn, axis=axis)
        return np.asarray(parts[..., 0] / parts[..., 1])

    found = None
    if of is np.mean:
        found = pooled(Pooled(tuple), values)
    elif len(pairs) >= LEAST_CLUSTERS:
        random = np.random.default_rng(SEED_OF_INTERVALS)
        found = bootstrap_interval(values, random, statistic=over, resamples=RESAMPLES)
    low, high = (found.low, found.high) if found else (None, None)
    return Figure(float(over(values, 0)), low, high, len(pairs), "")


def mean(name: str, unit: str = "", *, interval: bool = True) -> Measure:
    """Return the mean over trials of an entry of the record (of a dict, or an attribute)."""

    def parts(record: Any) -> tuple[float, float]:
        value = entry(record, name)
        return (0.0, 0.0) if value is None else (float(value), 1.0)

    return Measure(Pooled(parts), unit, interval)


def share(name: str) -> Measure:
    """Return the share of trials of which an entry of the record is true."""

    def parts(record: Any) -> tuple[float, float]:
        value = entry(record, name)
        return (0.0, 0.0) if value is None else (float(bool(value)), 1.0)

    return Measure(Share(parts))


def median(name: str, unit: str = "", *, interval: bool = True) -> Measure:
    """Return the median over trials of an entry of the record."""
    return Measure(statistic(name, np.median), unit, interval)


def only(name: str, unit: str = "") -> Measure:
    """Return the entry of the record where a case has one seed; a mean over seeds otherwise."""
    return mean(name, unit, interval=False)


def statistic(name: str, function: Callable[..., Any]) -> Callable[[Sequence[Any]], float | None]:
    """Return a figure: a statistic over the trials whose record has the entry."""

    def figure(records: Sequence[Any]) -> float | None:
        values = [v for r in records if (v := entry(r, name)) is not None]
        return float(function(values)) if values else None

    return figure


def entry(record: Any, name: str) -> float | None:
    """Return an entry of a record, None where it has none."""
    return record.get(name) if isinstance(record, Mapping) else getattr(record, name, None)


def count(records: Sequence[Any]) -> float:
    """The number of trials, as a figure."""
    return float(len(records))
