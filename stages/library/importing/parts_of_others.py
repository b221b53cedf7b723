"""Descriptions that are no models by themselves: parts that others include, older versions of a Gazebo model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.stages.library.importing.mjcf_models import named_by_mjcf
from scenewright.stages.library.importing.sdf_tree import files_of_config, named_by_sdf
from scenewright.stages.library.importing.source_folder import SourceFolder

MARKS = (b"<include", b"<model")
"""What a file holds that includes others."""


def parts_of_others(folder: SourceFolder, files: Sequence[Path]) -> set[Path]:
    """Return the files (resolved) that others include, directly or not; of a circle of them none.

    By itself a part lacks what stands around it: angles in radians, default classes, a pose.
    """
    includes = {path.resolve(): named for path in files if (named := _included(folder, path))}
    named_by_another = {part for path, parts in includes.items() for part in parts if part != path}
    parts: set[Path] = set()
    whole = [path for path in includes if path not in named_by_another]
    waiting = list(whole)
    while waiting:
        for part in includes.get(waiting.pop(), ()):
            if part not in parts:
                parts.add(part)
                waiting.append(part)
    return parts.difference(whole)


def older_versions(folder: SourceFolder, files: Sequence[Path]) -> set[Path]:
    """Return the files (resolved) that a `model.config` lists beside the newest: the same model in older SDF."""
    older: set[Path] = set()
    for path in files:
        if path.name == "model.config":
            with suppress(BadInput):
                older.update(files_of_config(folder, path)[1:])
    return older


def _included(folder: SourceFolder, path: Path) -> list[Path]:
    """Return the files that one includes; a broken one is told when it is read."""
    suffix = path.suffix.lower()
    if suffix not in (".xml", ".mjcf", ".sdf", ".world"):
        return []
    try:
        if not any(mark in folder.read(path) for mark in MARKS):
            return []
        root = folder.read_xml(path)
        if suffix in (".sdf", ".world"):
            return list(named_by_sdf(folder, path, root))
        if root.tag not in ("mujoco", "mujocoinclude"):
            return []
        return [file for name in named_by_mjcf(root) if (file := folder.find(name, path.parent)) is not None]
    except BadInput:
        return []


def lone_parts(folder: SourceFolder, files: Sequence[Path]) -> Iterator[Path]:
    """Yield the files that are parts of an MJCF and hold bodies or geoms."""
    for path in files:
        with suppress(BadInput):
            root = folder.read_xml(path) if path.suffix.lower() == ".xml" else None
            if root is not None and root.tag == "mujocoinclude" and root.find(".//geom") is not None:
                yield path
