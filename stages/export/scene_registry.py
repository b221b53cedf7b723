"""The formats of `export scene`, found in `scene_formats/`, and what each says of itself. Cheap to import."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from importlib.util import find_spec
from typing import Any

from scenewright.schemas.errors import MissingDependency
from scenewright.stages.kit.declared import Found, found_in, module_of
from scenewright.stages.kit.library_versions import library_version
from scenewright.stages.kit.stage import Extra


@dataclass(frozen=True)
class SceneFormat:
    """A format, as the `__init__.py` of its folder declares it under the name FORMAT.

    `writer.py` of that folder holds `write(folder: Path, scene: SceneToExport) -> Written`; it is loaded when it is
    used.
    """

    name: str
    """What `--to` calls it; the name of its folder."""
    order: int
    """Its place in the help; the first is the default."""
    file: str
    """What is to be opened."""
    summary: str
    """For the help."""
    extra: Extra | None = None
    """The library that it needs and that does not come with the project."""
    notes: tuple[str, ...] = ()
    """What a reader has to know of every export."""

    @property
    def module(self) -> str:
        """The module with `write`."""
        return f"{module_of(_found(), self.name)}.writer"


@dataclass(frozen=True)
class Written:
    """What a writer could not write as it stands in the scene."""

    names: dict[str, str] = field(default_factory=dict)
    """Name in the format -> name in the scene, where they differ."""
    joint_zero: dict[str, float] = field(default_factory=dict)
    """Joint -> value that the format's zero stands for [rad, m], where that is not 0."""


@cache
def _found() -> tuple[Found[SceneFormat], ...]:
    return found_in("scenewright.stages.export.scene_formats", SceneFormat, "FORMAT", "scenewright.scene_formats")


@cache
def scene_formats() -> tuple[SceneFormat, ...]:
    """Return every declared format in its order. Imports declarations only."""
    return tuple(found.declaration for found in _found())


def scene_format(name: str) -> SceneFormat:
    """Return the format of a name. Raises KeyError."""
    for declared in scene_formats():
        if declared.name == name:
            return declared
    raise KeyError(name)


def versions(parameters: Any) -> dict[str, str]:
    """Return name -> version of the library that a target needs. Raises MissingDependency where it is not installed."""
    extra = scene_format(parameters.to).extra
    if extra is None:
        return {}
    if find_spec(extra.module) is None:
        raise MissingDependency(f"{extra.distribution} is not installed", hint=extra.remedy.rpartition(": ")[2])
    return {extra.distribution: library_version(extra.distribution)}
