"""The folder that is imported: files are found and read inside it, and nowhere else."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_content
from scenewright.stages.kit.formats.xml_files import parse_xml

LARGEST_FILE = 256 * 2**20
"""Largest mesh or picture [bytes]."""
LARGEST_TEXT = 128 * 2**20
"""Bytes of a mesh that is text, which takes several times as much while it is read."""
LARGEST_XML = 64 * 2**20
"""Largest XML file [bytes]; a bound, by eye."""
MOST_FILES = 200_000
"""Most files of a folder with models; a bound, by eye."""
MOST_FOLDERS = 200_000
"""Most folders in a folder with models; a bound, by eye."""
MOST_NAME_PARTS = 40
"""Folders in the name of a file: its end is looked for in many places."""
MOST_KEPT_NAMES = 20_000
"""Most names whose files are remembered; by eye."""
PIECE = 1 << 20
"""Characters of a text that are parsed at a time; by eye."""
LONGEST_NUMBER = 4096
"""Longest number in a text [characters]."""
LONGEST_ROW = 100_000
"""Characters of a row that is a size or a pose; what comes after them makes it the wrong number of numbers anyway."""
BLANK = re.compile(r"\s")
SCHEME = re.compile(r"^(?:model|package|file)://+", re.IGNORECASE)


class SourceFolder:
    """A folder of other people's files. What its files name is looked for inside it, whatever the name says."""

    def __init__(self, root: Path) -> None:
        self.root = Path(root).resolve()
        self.kept_meshes: dict[Path, Any] = {}
        """What mesh_reading.py keeps of files that are named again and again."""
        self._file_of: dict[tuple[str, tuple[Path, ...]], Path | None] = {}
        self.read_bytes_of: set[Path] = set()
        """Files that were read; what no description names may be a model by itself."""

    def files(self) -> list[Path]:
        """Return the files, sorted by path; hidden ones and links out of the folder are left out. Raises BadInput."""
        real_files = [path for path in self._walk() if path.is_file() and self._inside(path)]
        return sorted(real_files, key=lambda p: p.relative_to(self.root).as_posix())

    def _walk(self) -> Iterator[Path]:
        waiting, folders, files = [str(self.root)], 0, 0
        while waiting:
            try:
                entries = list(_entries(waiting.pop()))
            except OSError:
                continue  # a folder that may not be read
            for name, is_folder in entries:
                folders, files = folders + is_folder, files + (not is_folder)
                if folders > MOST_FOLDERS or files > MOST_FILES:
                    raise BadInput(f"{self.root}: more than {MOST_FILES} files", hint="import its parts one by one")
                if is_folder:
                    waiting.append(name)
                else:
                    yield Path(name)

    def relative(self, path: Path) -> str:
        """Return the path below the folder, with /."""
        return path.relative_to(self.root).as_posix()

    def read(self, path: Path, largest: int = LARGEST_FILE) -> bytes:
        """Return a file's bytes. Raises BadInput when it is too large, or cannot be read."""
        data = file_content(path, largest, hint="simplify it, or leave it out")
        self.read_bytes_of.add(path.resolve())
        return data

    def read_xml(self, path: Path) -> ElementTree.Element:
        """Return the root element of an XML file (no document types). Raises BadInput.

        A declaration that says nothing but UTF-8 is dropped first: model files are found with blank lines before it
        and with versions that there are not, which other readers let pass.
        """
        data = self.read(path, LARGEST_XML)
        start = re.match(rb"(?:\xef\xbb\xbf)?\s*<\?xml[^>]{0,200}\?>", data)
        if start and re.search(rb"encoding\s*=\s*[\"'](?!utf-8|us-ascii)", start[0], re.IGNORECASE) is None:
            data = data[start.end() :]
        return parse_xml(data, str(path))

    def find(self, name: str, *bases: Path) -> Path | None:
        """Return the file that `name` means in a file that lies in one of `bases`, or None.

        Tried are the name itself from each base; then its end, ever shorter, from each base, the folders above it up
        to the root: so `model://chair/meshes/a.dae` is found, and `../repository/b.stl` of a folder that was renamed.
        """
        if len(name) > 1000 or "\0" in name:
            return None
        if len(self._file_of) > MOST_KEPT_NAMES:
            self._file_of.clear()
        if (name, bases) not in self._file_of:
            self._file_of[name, bases] = self._search(name, bases)
        return self._file_of[name, bases]

    def _search(self, name: str, bases: tuple[Path, ...]) -> Path | None:
        plain = SCHEME.sub("", name.strip().replace("\\", "/"))
        if not plain:
            return None
        names = [part for part in PurePosixPath(plain).parts if part not in ("/", ".", "..")]
        if not 0 < len(names) <= MOST_NAME_PARTS:
            return None
        places: list[Path] = []
        for base in bases:
            places += [base, *(above for above in base.parents if above.is_relative_to(self.root))]
        places = list(dict.fromkeys(places))
        exact = [base / plain for base in bases] if not PurePosixPath(plain).is_absolute() else []
        for candidate in [
            *exact,
            *(place_of_search.joinpath(*names[k:]) for k in range(len(names)) for place_of_search in places),
        ]:
            if candidate.is_file() and self._inside(candidate):
                return candidate.resolve()
        return None

    def _inside(self, path: Path) -> bool:
        try:
            return path.resolve().is_relative_to(self.root)
        except (OSError, RuntimeError, ValueError):
            return False


def numbers(text: str | None, count: int, where: str) -> np.ndarray:
    """Return exactly `count` finite numbers. Raises BadInput, beginning with `where`."""
    values = list_of_numbers(text, where)
    if len(values) != count:
        raise BadInput(f"{where}: {text!r:.80} is not {count} numbers")
    return values


def _entries(folder: str) -> Iterator[tuple[str, bool]]:
    """Yield (path, whether it is a folder) of what lies in a folder and is not hidden; links are no folders."""
    with os.scandir(folder) as entries:
        for entry in entries:
            if not entry.name.startswith("."):
                yield entry.path, entry.is_dir(follow_symlinks=False)


def long_row(text: str, kind: type[np.float64] | type[np.int64], most: int, where: str) -> np.ndarray:
    """Return up to `most` numbers separated by blanks, read piece by piece: a list of words takes 30 times the text.

    Raises BadInput, beginning with `where`, for more; ValueError and OverflowError for what is no number.
    """
    rows, start, count = [np.zeros(0, dtype=kind)], 0, 0
    while start < len(text):
        blank = BLANK.search(text, start + PIECE, start + PIECE + LONGEST_NUMBER)
        if blank is None and start + PIECE + LONGEST_NUMBER < len(text):
            raise BadInput(f"{where}: a number of more than {LONGEST_NUMBER} characters")
        end = len(text) if blank is None else blank.start()
        rows.append(np.array(text[start:end].split(), dtype=kind))
        start, count = end, count + len(rows[-1])
        if count > most:
            raise BadInput(f"{where}: more than {most} numbers", hint="simplify it, or split it")
    return np.concatenate(rows)


def list_of_numbers(text: str | None, where: str) -> np.ndarray:
    """Return finite numbers separated by blanks. Raises BadInput, beginning with `where`."""
    try:
        values = np.array((text or "")[:LONGEST_ROW].split(), dtype=float)
    except ValueError:
        hint = "a xacro expression: let xacro write the URDF" if "${" in (text or "") else ""
        raise BadInput(f"{where}: {text!r:.80} is not a row of numbers", hint=hint) from None
    if not np.isfinite(values).all() or (np.abs(values) > 1e30).any():
        raise BadInput(f"{where}: {text!r:.80} is not finite")
    return values
