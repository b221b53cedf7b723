"""Which seeds figures may be of: reporting_seeds.toml holds them, the date of their first use, and what they met.

A change that is made after figures were seen was tuned on them. So the file records under which digest of the method a
set of seeds was measured, and a set that two digests of one experiment have met is a tuning set from then on.
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any, Literal

from scenewright.schemas.base import canonical_json
from scenewright.stages.engine.code.digests import step_code
from scenewright.stages.engine.discovery import stage_by_name

FILE = Path(__file__).with_name("reporting_seeds.toml")
UNRECORDED = "unrecorded"
"""Digest of what was measured before the file existed: which code it was is not known, so it counts as another one."""


@dataclass(frozen=True)
class Method:
    """What an experiment compares: its digest changes with the code of the steps and with the settings of the arms."""

    steps: Sequence[str]
    settings: Mapping[str, Any]
    """Arm -> plain values."""

    def digest(self) -> str:
        """Return the sha256 over the code of every step as it stands, and the settings."""
        facts = {name: step_code(stage_by_name(name)).digest for name in self.steps}
        return hashlib.sha256(canonical_json({"steps": facts, "arms": dict(self.settings)}).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Met:
    """One digest of a method that a set was measured under."""

    experiment: str
    method: str
    day: date


@dataclass(frozen=True)
class SeedSet:
    """Seeds that are used together."""

    name: str
    group: str
    """What they are seeds of."""
    seeds: tuple[str, ...]
    met: tuple[Met, ...] = ()

    @property
    def first_used(self) -> date | None:
        """When figures of these seeds were first made; None while nobody has."""
        return min((met.day for met in self.met), default=None)

    @property
    def kind(self) -> Literal["reporting", "tuning"]:
        """Tuning once two methods of one experiment, or one that nobody recorded, have met the seeds."""
        pairs = {(met.experiment, met.method) for met in self.met}
        several = len({experiment for experiment, _ in pairs}) < len(pairs)
        return "tuning" if several or any(method == UNRECORDED for _, method in pairs) else "reporting"

    def met_first(self, experiment: str) -> str | None:
        """Return the digest under which an experiment first measured these seeds."""
        return next((met.method for met in self.met if met.experiment == experiment), None)


def read_sets(file: Path = FILE) -> tuple[SeedSet, ...]:
    """Return the sets of the file in their order. Raises ValueError where a use names no set or a name comes twice."""
    content = tomllib.loads(file.read_text(encoding="utf-8"))
    met: dict[str, list[Met]] = {entry["name"]: [] for entry in content["set"]}
    if len(met) < len(content["set"]):
        raise ValueError(f"{file}: two sets have one name")
    for entry in content.get("met", []):
        if entry["set"] not in met:
            raise ValueError(f"{file}: no set {entry['set']!r}")
        met[entry["set"]].append(Met(entry["experiment"], entry["method"], entry["day"]))
    return tuple(
        SeedSet(entry["name"], entry["group"], _seeds(entry["seeds"]), tuple(met[entry["name"]]))
        for entry in content["set"]
    )


def _seeds(said: str | Sequence[str]) -> tuple[str, ...]:
    """Return the seeds of a list, or of "3200..3699", both ends included."""
    if not isinstance(said, str):
        return tuple(said)
    first, last = map(int, said.split(".."))
    return tuple(map(str, range(first, last + 1)))


def newest(group: str, file: Path = FILE) -> SeedSet:
    """Return the last set of a group: the one that is measured now."""
    return [found for found in read_sets(file) if found.group == group][-1]


def note_use(name: str, experiment: str, method: str, file: Path = FILE) -> SeedSet:
    """Record that an experiment measures a set with this digest of its method, unless that is known; return the set."""
    found = {entry.name: entry for entry in read_sets(file)}[name]
    if all((met.experiment, met.method) != (experiment, method) for met in found.met):
        day = datetime.now(UTC).date().isoformat()
        with file.open("a", encoding="utf-8") as stream:
            stream.write(f'\n[[met]]\nset = "{name}"\nexperiment = "{experiment}"\nmethod = "{method}"\nday = {day}\n')
        found = {entry.name: entry for entry in read_sets(file)}[name]
    return found
