"""Edits are applied in the order of the file and look for their things in what those before them left, so that an edit
may mean a thing that an earlier one made."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol, TypeVar

from scenewright.schemas.edits import AnyEdit, AppliedEdit, Edit
from scenewright.stages.edit.anchoring import Conflict, Fitting, Where


class State(Where, Protocol):
    """What is edited."""

    def name_of(self, instance: int) -> str:
        """Return what a thing with an instance number is called now."""


@dataclass(frozen=True)
class Done:
    """What an edit came to."""

    status: Literal["applied", "already"]
    instances: tuple[int, ...] = ()
    reason: str = ""


Edited = TypeVar("Edited", bound=State)
Table = Mapping[type[Edit], Callable[[Edited, Any, Fitting], Done]]
"""Kind of edit -> what changes the state; it raises Conflict and leaves the state as it is."""


def apply_edits(state: Edited, edits: Iterable[AnyEdit], fitting: Fitting, table: Table[Edited]) -> list[AppliedEdit]:
    """Apply the edits of the kinds of a table, one after the other, and return what became of each; others are left
    out."""
    records = []
    for number, edit in enumerate(edits, 1):
        if type(edit) not in table:
            continue
        record = AppliedEdit(
            number=number, what=edit.what, status="conflict", by=edit.by, when=edit.when, note=edit.note
        )
        try:
            done = table[type(edit)](state, edit, fitting)
        except Conflict as conflict:
            records.append(record.model_copy(update={"reason": str(conflict)}))
            continue
        names = tuple(state.name_of(k) for k in done.instances)
        records.append(record.model_copy(update={"status": done.status, "things": names, "reason": done.reason}))
    return records
