"""What is said of edits that were applied: in edits.json, in the log, in the summary of the artifact."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from scenewright.schemas.edits import AppliedEdit, AppliedEditsFile
from scenewright.stages.kit.stage import Context


def write_records(records: Sequence[AppliedEdit], asked: int, context: Context) -> dict[str, int | str]:
    """Write edits.json, warn of conflicts, and return the counts of a summary; `asked`: lines of the file."""
    for record in records:
        if record.status == "conflict":
            context.logger.warning("edit %d (%s): %s", record.number, record.what, record.reason)
    AppliedEditsFile(edits=tuple(records)).write(Path(context.output) / "edits.json")
    counted = Counter(record.status for record in records)
    summary: dict[str, int | str] = {
        "edits": asked,
        "applied": counted["applied"],
        "already": counted["already"],
        "conflicts": counted["conflict"],
        "elsewhere": asked - len(records),
    }
    if counted["conflict"]:
        first = next(record for record in records if record.status == "conflict")
        summary["reason"] = f"edit {first.number} ({first.what}): {first.reason}"
    return summary


def outcome_of(records: Sequence[AppliedEdit]) -> str:
    """Return the outcome of an artifact that edits were applied to."""
    return "conflicts" if any(record.status == "conflict" for record in records) else "ok"
