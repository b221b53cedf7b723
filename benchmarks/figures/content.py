"""What docs/results/<experiment>.json and words.toml hold (docs/results/index.md describes it)."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


class FiguresError(Exception):
    """A page or a JSON file that can't be rendered; the message says where and why."""


@dataclass(frozen=True)
class Figure:
    """One measured value; `low` and `high` are None where no interval was measured."""

    value: float | int | None
    low: float | None
    high: float | None
    cases: int | None
    unit: str

    @property
    def has_interval(self) -> bool:
        return self.low is not None and self.high is not None


@dataclass(frozen=True)
class Experiment:
    """What docs/results/<name>.json holds (docs/results/index.md describes it)."""

    name: str
    about: Mapping[str, Any]
    figures: Mapping[str, Figure]
    rows: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def figure(self, key: str) -> Figure:
        if key not in self.figures:
            raise FiguresError(f"{self.name}.json has no figure {key!r}")
        return self.figures[key]

    def day(self, key: str) -> str:
        """When a figure was measured: where parts of an experiment have days of their own, that of its part."""
        part = key.split("/")[1].split(" ")[0]
        return str(self.about.get("days", {}).get(part, self.about["date"]))

    def shown(self, part: str) -> str:
        """The words for an arm, a case or a measure."""
        return str(self.about.get("names", {}).get(part, part.replace("_", " ")))


REQUIRED = ("experiment", "title", "date", "commit", "machine", "command", "simulated", "knows", "does_not_show")


def load_experiments(folder: Path) -> dict[str, Experiment]:
    """Return the experiments of a folder by name; raises FiguresError where a file is not of the form."""
    words = tomllib.loads((folder / "words.toml").read_text())
    return {file.stem: load_experiment(file, words.get(file.stem, {})) for file in sorted(folder.glob("*.json"))}


def load_experiment(file: Path, words: Mapping[str, Any]) -> Experiment:
    """Return one experiment; `words` are its section of words.toml: `a_case`, `names`, and
    `interval`, how its intervals were made, where the file does not say it."""
    content = json.loads(file.read_text())
    missing = [name for name in (*REQUIRED, "figures") if not content.get(name)]
    if missing or content["experiment"] != file.stem:
        raise FiguresError(f"{file.name}: {'lacks ' + ', '.join(missing) if missing else 'is of another experiment'}")
    said = {name: content[name] for name in ("interval",) if name in content}
    figures = {}
    for key, entry in content["figures"].items():
        if len(key.split("/")) < 3 or set(entry) != {"value", "low", "high", "cases", "unit"}:
            raise FiguresError(f"{file.name}: {key!r} is no <arm>/<case>/<measure> with value, low, high, cases, unit")
        if (entry["low"] is None) != (entry["high"] is None):
            raise FiguresError(f"{file.name}: {key!r} has half an interval")
        figures[key] = Figure(**entry)
    return Experiment(file.stem, {**content, **words, **said}, figures, content.get("rows", {}))
