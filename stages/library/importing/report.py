"""The table that an import prints: one line a model."""

from __future__ import annotations

from collections.abc import Sequence

from scenewright.schemas.cad_library import ImportedModel
from scenewright.stages.kit.geometry.file_axes import unit_name

HEADER = ("model", "class", "size [m]", "joints", "unit", "up", "front", "good for", "findings")
LONGEST_NAME = 44
"""Longest name of a model in the table [characters]; the beginning of longer ones is left out."""


def table_lines(records: Sequence[ImportedModel]) -> list[str]:
    """Return the lines of the table; what was left out stands with a dash for its size."""
    rows = [HEADER, *(_row(record) for record in records)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(HEADER) - 1)]
    return [
        "  ".join([*(cell.ljust(width) for cell, width in zip(row, widths, strict=False)), row[-1]]).rstrip()
        for row in rows
    ]


def _row(record: ImportedModel) -> tuple[str, ...]:
    name = record.id or record.name
    name = name if len(name) <= LONGEST_NAME else f"...{name[3 - LONGEST_NAME :]}"
    findings = "; ".join(record.findings)
    if record.size is None or record.unit is None:
        return (name, record.class_name or "-", "-", "-", "-", "-", "-", "-", f"left out: {findings}")
    return (
        name,
        record.class_name,
        " x ".join(f"{length:.2f}" for length in record.size),
        str(record.joints),
        f"{unit_name(record.unit)} ({record.unit_from})",
        f"{record.up} ({record.up_from})",
        f"{record.front} ({record.front_from})",
        _good_for(record),
        findings,
    )


def _good_for(record: ImportedModel) -> str:
    """Return what can be done with a model, in few words."""
    uses = {
        "carried": record.can_be_carried,
        "opened": record.can_be_opened,
        "opened by a handle": record.can_be_opened and record.has_handle,
        "contains": record.can_contain,
        "supports": record.can_support,
    }
    if uses["opened by a handle"]:
        del uses["opened"]
    return ", ".join(use for use, can in uses.items() if can) or "-"
