"""The formats of `export`, found in `formats/`, and what each says of itself before it is loaded. Cheap to import."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cache

from scenewright.stages.kit.declared import Found, found_in, module_of

STREAMS = ("color", "depth", "right", "labels", "pose")


@dataclass(frozen=True)
class SequenceFormat:
    """A format, as the `__init__.py` of its folder declares it under the name FORMAT.

    `writer.py` of that folder holds `write(job: ExportJob) -> None`; it is loaded when it is used.
    """

    name: str
    """The name of its folder."""
    order: int
    """Its place in the help; the first layout is the default, and so is the first dialect."""
    layout: str
    """What `--layout` calls it."""
    streams: tuple[str, ...]
    """Streams of STREAMS that it has a place for."""
    summary: str
    """For the help."""
    dialect: str | None = None
    """What `--dialect` calls it, for one of several formats of a layout."""
    log: str = "."
    """What of the folder is to be opened."""
    one_camera: bool = False
    """Whether it holds one camera."""
    masks: bool = False
    """Whether it holds masks: those of `--segments`, else the labels of the sequence."""
    pose_note: str = ""
    """What a reader has to know of the poses beyond that they are world_from_camera."""
    depth_limit: float | None = None
    """Largest depth that it holds [m]."""
    depth_limit_reason: str = ""

    @property
    def module(self) -> str:
        """The module with `write`."""
        return f"{module_of(_found(), self.name)}.writer"


@cache
def _found() -> tuple[Found[SequenceFormat], ...]:
    return found_in("scenewright.stages.export.formats", SequenceFormat, "FORMAT", "scenewright.export_formats")


@cache
def all_formats() -> tuple[SequenceFormat, ...]:
    """Return every declared format in its order. Imports declarations only."""
    return tuple(found.declaration for found in _found())


def layouts() -> tuple[str, ...]:
    """Return the names of the layouts."""
    return tuple(dict.fromkeys(declared.layout for declared in all_formats()))


def dialects(of: Collection[str] | None = None) -> tuple[str, ...]:
    """Return the names of the dialects, of all layouts or of those in `of`."""
    formats = [declared for declared in all_formats() if of is None or declared.layout in of]
    return tuple(dict.fromkeys(declared.dialect for declared in formats if declared.dialect))


def format_for(layout: str, dialect: str) -> SequenceFormat:
    """Return the format of a layout; `dialect` counts where the layout has several. Raises KeyError."""
    for declared in all_formats():
        if declared.layout == layout and declared.dialect in (None, dialect):
            return declared
    raise KeyError((layout, dialect))
