"""What an experiment declares: arms x cases x seeds, a function that measures trials, and how records become figures.

An experiment is `benchmarks/experiments/<name>.py`, or `<name>/experiment.py` there where it needs more files, with an
`EXPERIMENT`; it is found by that place. `python -m benchmarks NAME` does the rest: which trials are wanted, which of
them are kept already, processes, intervals, metrics.json, figures.json, table.md, pictures.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np

from stages.kit.stage import Parameters

if TYPE_CHECKING:
    from benchmarks.results import Results


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
    """Seeds for figures alone."""
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
    more_figures: Callable[[Results], Mapping[str, float | None]] | None = None
    """Further `<arm>/<case>/<measure>` -> value, without intervals."""
    notes: Callable[[Results], str] | None = None
    """What table.md says after the figures, the differences and the single seeds."""
    pictures: Callable[[Results], None] | None = None
    """Draws and writes into the output folder what table.md does not hold."""
    problems: Callable[[Results], Sequence[str]] | None = None
    """What was expected and does not hold, in words; any makes the command exit with 4."""


def mean(name: str, unit: str = "", *, interval: bool = True) -> Measure:
    """Return the mean over trials of an entry of the record (of a dict, or an attribute)."""
    return Measure(statistic(name, np.mean), unit, interval)


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
