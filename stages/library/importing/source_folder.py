"""The folder that is imported: files are found and read inside it, and nowhere else."""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree

import numpy as np

from schemas.errors import BadInput
from stages.kit.formats.xml_files import parse_xml

LARGEST_FILE = 512 * 2**20
"""Bytes of a mesh or a picture."""
LARGEST_XML = 64 * 2**20
MOST_FILES = 200_000
SCHEME = re.compile(r"^(?:model|package|file)://+", re.IGNORECASE)


class SourceFolder:
    """A folder of other people's files. What its files name is looked for inside it, whatever the name says."""

    def __init__(self, root: Path) -> None:
        self.root = Path(root).resolve()
        self.read_bytes_of: set[Path] = set()
        """Files that were read; what no description names may be a model by itself."""

    def files(self) -> list[Path]:
        """Return the files, sorted by path; hidden ones and links out of the folder are left out. Raises BadInput."""
        found = []
        for path in sorted(self.root.rglob("*"), key=lambda p: p.relative_to(self.root).as_posix()):
            parts = path.relative_to(self.root).parts
            if any(part.startswith(".") for part in parts) or not path.is_file() or not self._inside(path):
                continue
            found.append(path)
            if len(found) > MOST_FILES:
                raise BadInput(f"{self.root}: more than {MOST_FILES} files", hint="import its parts one by one")
        return found

    def relative(self, path: Path) -> str:
        """Return the path below the folder, with /."""
        return path.relative_to(self.root).as_posix()

    def read(self, path: Path, largest: int = LARGEST_FILE) -> bytes:
        """Return a file's bytes. Raises BadInput when it is too large, or cannot be read."""
        try:
            if path.stat().st_size > largest:
                raise BadInput(f"{path}: larger than {largest} bytes")
            data = path.read_bytes()
        except (OSError, ValueError) as error:
            raise BadInput(f"{path}: {getattr(error, 'strerror', None) or error}") from None
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
        plain = SCHEME.sub("", name.strip().replace("\\", "/"))
        if not plain or "\0" in plain or len(plain) > 1000:
            return None
        parts = [part for part in PurePosixPath(plain).parts if part not in ("/", ".", "..")]
        if not parts:
            return None
        places: list[Path] = []
        for base in bases:
            places += [base, *(above for above in base.parents if above.is_relative_to(self.root))]
        places = list(dict.fromkeys(places))
        exact = [base / plain for base in bases] if not PurePosixPath(plain).is_absolute() else []
        for candidate in [*exact, *(place.joinpath(*parts[k:]) for k in range(len(parts)) for place in places)]:
            if self._inside(candidate) and candidate.is_file():
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


def list_of_numbers(text: str | None, where: str) -> np.ndarray:
    """Return finite numbers separated by blanks. Raises BadInput, beginning with `where`."""
    try:
        values = np.array((text or "").split(), dtype=float)
    except ValueError:
        raise BadInput(f"{where}: {text!r:.80} is no row of numbers") from None
    if not np.isfinite(values).all() or (np.abs(values) > 1e30).any():
        raise BadInput(f"{where}: {text!r:.80} is not finite")
    return values
