"""The log layouts of `ingest`, found in `layouts/`, and what each says of itself before it is loaded. Cheap."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from scenewright.stages.kit.declared import declared_in


@dataclass(frozen=True)
class LogLayout:
    """A layout, as the `__init__.py` of its folder declares it under the name LAYOUT.

    Its module `reader` holds `matches(path) -> str | None` (the rule that matched, in words; None: something else) and
    `open_source(path, parameters, rule) -> LogSource`; it is loaded when a log is looked at.
    """

    name: str
    """What `--format` calls it."""
    order: int
    """Its place among those that `auto` tries: a layout comes before those whose rules would match its logs too."""
    recognised_by: str
    """For people."""
    reader: str
    """The module, by its full name."""


@cache
def all_layouts() -> tuple[LogLayout, ...]:
    """Return every declared layout in the order in which they are tried. Imports declarations only."""
    return declared_in("scenewright.stages.ingest.layouts", LogLayout, "LAYOUT", "scenewright.layouts")
