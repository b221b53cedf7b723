"""What two runs, or two artifacts, differ in: parameters, versions, inputs, outcomes, measures, files, sizes, times."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from scenewright.schemas.edits import AppliedEditsFile
from scenewright.schemas.errors import BadInput
from scenewright.schemas.evaluation import Evaluation, MetricsFile
from scenewright.schemas.manifest import Manifest
from scenewright.schemas.plain_text import cleaned
from scenewright.stages.engine.reading import read_manifest
from scenewright.stages.engine.run_folders import artifacts_of, is_artifact

Status = Literal["same", "different", "only in first", "only in second", "unreadable"]

VERSIONS = ("package_version", "git_commit", "git_dirty", "lock_digest", "python", "platform", "device")
"""Fields of the provenance that are compared."""


@dataclass(frozen=True)
class Change:
    """One thing that is not the same. None: it is not there on that side."""

    group: str
    """`stage`, `parameter`, `library`, `data file`, `input`, `version`, `outcome`, `summary`, `edit` or `problem`."""
    name: str
    before: Any
    after: Any


@dataclass(frozen=True)
class Figure:
    """A number on both sides."""

    name: str
    before: float | None
    after: float | None

    @property
    def change(self) -> float | None:
        """The second minus the first; None where either is undefined."""
        return None if self.before is None or self.after is None else self.after - self.before

    @property
    def relative(self) -> float | None:
        """The change as a share of the first; None where that is undefined."""
        share = self.change / abs(self.before) if self.change is not None and self.before else math.nan
        return share if math.isfinite(share) else None

    def as_json(self) -> dict[str, Any]:
        """Return the figure with its change, for --json."""
        return {
            "name": self.name,
            "before": self.before,
            "after": self.after,
            "change": self.change,
            "relative": self.relative,
        }


@dataclass(frozen=True)
class FileChanges:
    """Payload files that are not the same, by path; those that no digest covers (wall clock) are left out."""

    changed: tuple[str, ...] = ()
    removed: tuple[str, ...] = ()
    """Only in the first."""
    added: tuple[str, ...] = ()
    """Only in the second."""

    @property
    def count(self) -> int:
        """How many."""
        return len(self.changed) + len(self.removed) + len(self.added)


@dataclass(frozen=True)
class ArtifactComparison:
    """One artifact of the first run beside that of the same name in the second."""

    name: str
    kind: str
    status: Status
    """`same`: the same content, whatever made it."""
    changes: tuple[Change, ...] = ()
    measures: tuple[Figure, ...] = ()
    """Those of an evaluation that differ."""
    equal_measures: int = 0
    files: FileChanges = FileChanges()
    costs: tuple[Figure, ...] = ()
    """`bytes`, `seconds`, `peak_memory_bytes`."""

    def as_json(self) -> dict[str, Any]:
        """Return everything, for --json."""
        return {
            "name": self.name,
            "kind": self.kind,
            "status": self.status,
            "changes": [vars(change) for change in self.changes],
            "measures": [figure.as_json() for figure in self.measures],
            "equal_measures": self.equal_measures,
            "files": {name: list(paths) for name, paths in vars(self.files).items()},
            "costs": [figure.as_json() for figure in self.costs],
        }


def compare(first: Path, second: Path) -> list[ArtifactComparison]:
    """Compare two artifacts, or two runs artifact by artifact, in the order in which the first was made.

    Raises BadInput when either is neither, or when one is a run and the other an artifact.
    """
    first, second = Path(first), Path(second)
    for path in (first, second):
        if not os.path.isdir(path):
            raise BadInput(f"{path}: no such folder", hint="give two run folders, or two artifact folders")
    if is_artifact(first) and is_artifact(second):
        name = first.name if first.name == second.name else f"{first.name} | {second.name}"
        return [_compare_one(name, first, second)]
    if is_artifact(first) or is_artifact(second):
        raise BadInput(
            f"{first} and {second}: one is an artifact, the other is not",
            hint="give two run folders, or two artifact folders",
        )
    before, after = artifacts_of(first), artifacts_of(second)
    comparisons = [_compare_one(name, before.get(name), after.get(name)) for name in sorted(set(before) | set(after))]
    order = {name: _start_time(path) for name, path in (after | before).items()}
    return sorted(comparisons, key=lambda item: (order[item.name], item.name))


def _start_time(path: Path) -> str:
    try:
        return read_manifest(path).provenance.started
    except BadInput:
        return ""


def _compare_one(name: str, first: Path | None, second: Path | None) -> ArtifactComparison:
    manifests, problems = [], []
    for number, path in (("first", first), ("second", second)):
        try:
            manifests.append(None if path is None else read_manifest(path))
        except BadInput as error:
            problems.append(Change("problem", number, None, str(error)))
    if problems:
        return ArtifactComparison(name, "unknown", "unreadable", tuple(problems))
    before, after = manifests
    if before is None or after is None:
        either = before or after
        assert either is not None
        return ArtifactComparison(name, either.kind, "only in second" if before is None else "only in first")
    assert first is not None and second is not None
    changes = list(_changes(before, after))
    try:
        changes += _differences("edit", _edits(first), _edits(second))
    except BadInput as error:
        changes.append(Change("problem", "edits", None, str(error)))
    measures: list[Figure] = []
    if before.kind == after.kind == Evaluation.kind:
        measures, broken = _measures(first, second)
        changes += broken
    differing = tuple(figure for figure in measures if figure.before != figure.after)
    return ArtifactComparison(
        name=name,
        kind=before.kind if before.kind == after.kind else f"{before.kind} | {after.kind}",
        status="same" if before.content_digest == after.content_digest else "different",
        changes=tuple(changes),
        measures=differing,
        equal_measures=len(measures) - len(differing),
        files=_file_changes(before, after),
        costs=_costs(before, after),
    )


def _changes(before: Manifest, after: Manifest) -> list[Change]:
    """List what differs in how the two were made and in what they say of themselves."""
    changes = []
    for field in ("stage", "code", "schema_version", "seed", "device_kind"):
        changes += _differences("stage", {field: getattr(before, field)}, {field: getattr(after, field)})
    for group, field in (("parameter", "parameters"), ("library", "libraries"), ("data file", "data_files")):
        changes += _differences(group, getattr(before, field), getattr(after, field))
    changes += _differences(
        "accepted code",
        *({a.step: f"{a.made_with:.12} -> {a.accepted:.12}" for a in m.accepted_code} for m in (before, after)),
    )
    changes += _differences("input", *({record.role: record.digest for record in m.inputs} for m in (before, after)))
    changes += _differences("version", *({f: getattr(m.provenance, f) for f in VERSIONS} for m in (before, after)))
    changes += _differences("outcome", {"outcome": before.outcome}, {"outcome": after.outcome})
    changes += _differences("summary", before.summary, after.summary)
    return changes


def _edits(root: Path) -> dict[str, str]:
    """Return what became of each edit by hand of an artifact, and who made it."""
    path = root / "edits.json"
    if not path.is_file():
        return {}
    return {
        f"{edit.number} ({edit.what})": cleaned(
            ", ".join(word for word in (edit.status, *edit.things, edit.reason, edit.by, edit.when, edit.note) if word)
        )
        for edit in AppliedEditsFile.read(path).edits
    }


def _differences(group: str, before: Mapping[str, Any], after: Mapping[str, Any]) -> list[Change]:
    names = sorted(set(before) | set(after))
    return [Change(group, n, before.get(n), after.get(n)) for n in names if before.get(n) != after.get(n)]


def _measures(first: Path, second: Path) -> tuple[list[Figure], list[Change]]:
    tables: list[dict[str, float | None]] = []
    problems = []
    for number, path in (("first", first), ("second", second)):
        try:
            tables.append(MetricsFile.read(path / "metrics.json").metrics)
        except BadInput as error:
            problems.append(Change("problem", number, None, str(error)))
    if problems:
        return [], problems
    before, after = tables
    return [Figure(name, before.get(name), after.get(name)) for name in sorted(set(before) | set(after))], []


def _file_changes(before: Manifest, after: Manifest) -> FileChanges:
    digests_before = {record.path: record.sha256 for record in before.files if record.digested}
    digests_after = {record.path: record.sha256 for record in after.files if record.digested}
    return FileChanges(
        changed=tuple(
            sorted(
                path
                for path in digests_before.keys() & digests_after.keys()
                if digests_before[path] != digests_after[path]
            )
        ),
        removed=tuple(sorted(digests_before.keys() - digests_after.keys())),
        added=tuple(sorted(digests_after.keys() - digests_before.keys())),
    )


def _costs(before: Manifest, after: Manifest) -> tuple[Figure, ...]:
    def values(manifest: Manifest) -> dict[str, float]:
        provenance = manifest.provenance
        total = math.fsum(record.bytes for record in manifest.files)
        return {"bytes": total, "seconds": provenance.seconds, "peak_memory_bytes": float(provenance.peak_memory_bytes)}

    values_before, values_after = values(before), values(after)
    return tuple(Figure(name, values_before[name], values_after[name]) for name in values_before)
