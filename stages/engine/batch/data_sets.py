"""The scenes of a data set: folders, a glob, a list of paths."""

from __future__ import annotations

import glob
import os
from pathlib import Path, PurePath

from scenewright.schemas.errors import UsageError
from scenewright.schemas.outside import file_text
from scenewright.stages.engine.batch.names import distinct, matched_part, names_from_paths
from scenewright.stages.engine.batch.spec import DataSpec

LARGEST_LIST = 64 * 2**20
"""Largest list of paths [bytes]."""


def _absolute(text: str, base: Path) -> Path:
    return Path(os.path.abspath(base / os.path.expanduser(text)))


def _read_list(file: Path, where: str) -> list[str]:
    try:
        lines = file_text(file, LARGEST_LIST, error=UsageError).splitlines()
    except UsageError as error:
        raise UsageError(f"{where}: list: {error.message}", hint="a text file with one path a line") from None
    lines_with_text = [line.strip() for line in lines if line.strip() and not line.lstrip().startswith("#")]
    if not lines_with_text:
        raise UsageError(f"{where}: list: {file} names nothing", hint="one path a line")
    return lines_with_text


def find_scenes(data: DataSpec, base: Path, where: str) -> list[tuple[str, Path]]:
    """Return name and absolute path of every scene: folders, then what the glob finds (sorted), then the list.

    `base` is the folder of the batch file, `where` its name for messages. Raises UsageError for a path that does not
    exist, a glob or list without a match, and a path that is named twice.
    """
    if not data.folders and data.glob is None and data.list is None:
        raise UsageError(f"{where}: data: no folders, glob or list", hint="give at least one")
    listed = [_absolute(folder, base) for folder in data.folders]
    for folder in listed:
        if not folder.is_dir():
            raise UsageError(f"{where}: data: {folder}: no such folder", hint="check folders")
    if data.list is not None:
        file = _absolute(data.list, base)
        for line in _read_list(file, where):
            path = _absolute(line, base)
            if not path.exists():
                raise UsageError(f"{where}: data: {path}: no such file or folder", hint=f"check {file}")
            listed.append(path)
    name_of: dict[Path, str] = {}
    if data.glob is not None:
        pattern = str(Path(os.path.expanduser(data.glob)))
        matches = sorted(glob.glob(pattern, root_dir=base, recursive=True))
        if not matches:
            raise UsageError(f"{where}: data: glob {data.glob}: no match in {base}", hint="check the pattern")
        name_of = {_absolute(match, base): matched_part(PurePath(match), pattern) for match in matches}
    paths = [*listed[: len(data.folders)], *name_of, *listed[len(data.folders) :]]
    by_path: dict[str, Path] = {}
    for path in paths:
        if not str(path).isprintable():  # such names survive neither JSON nor a log of lines
            raise UsageError(f"{where}: data: {str(path)!r}: not a printable name", hint="rename it")
        real = os.path.realpath(path)
        if real in by_path:
            raise UsageError(f"{where}: data: {path} is named twice", hint="each scene once")
        by_path[real] = path
    names = dict(zip(listed, names_from_paths(listed), strict=True)) | name_of
    longer = names_from_paths(paths)
    unique = distinct([[names[path], long] for path, long in zip(paths, longer, strict=True)])
    return list(zip(unique, paths, strict=True))
