"""Where Record3D's files lie: an .r3d file (a ZIP archive), the same unpacked, or the export as EXR and JPG.

`metadata` is JSON; frame N is rgbd/N.jpg with N.depth (float32 metres, LZFSE) and N.conf (uint8, LZFSE), or rgb/N.jpg
with depth/N.exr (marek-simonik/record3d, issues 7 and 93).
"""

from __future__ import annotations

import re
import zipfile
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any

from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import json_of, opened
from scenewright.stages.ingest.folders.files import LARGEST_IMAGE_FILE, file_bytes, read_json
from scenewright.stages.ingest.source import Unusable
from scenewright.stages.kit.formats.zip_files import find_entry, zip_errors

LARGEST_METADATA = 64 * 2**20
"""Bytes: an hour at 60 frames a second has 20 MB."""
AGAIN = "export the recording from the app again"


class Recording(ABC):
    """The files of a recording by name, such as `rgbd/12.jpg`."""

    root: Path

    @abstractmethod
    def metadata(self) -> Any:
        """Return the JSON document. Raises BadInput."""

    @abstractmethod
    def names(self) -> list[str]:
        """Return the names of all files, in order."""

    @abstractmethod
    def content(self, name: str, stream: str) -> bytes:
        """Return the bytes of a file. Raises Unusable naming the `stream`."""

    def path(self, name: str) -> Path | None:
        """Return the file on disk, None inside of an archive."""
        return None

    def numbered(self, folder: str, ending: str) -> dict[int, str]:
        """Return number -> name of the files N`ending` of a folder, by number."""
        pattern = re.compile(rf"{re.escape(folder)}/(\d{{1,9}}){re.escape(ending)}", re.IGNORECASE)
        found = ((pattern.fullmatch(name), name) for name in self.names())
        return dict(sorted((int(match[1]), name) for match, name in found if match))

    def close(self) -> None:  # noqa: B027 (a folder has nothing open)
        """Close what is open."""


class FolderRecording(Recording):
    """An unpacked recording, or an export."""

    def __init__(self, root: Path, metadata: str) -> None:
        self.root, self._metadata = root, metadata

    def metadata(self) -> Any:
        """Return the JSON document. Raises BadInput."""
        return read_json(self.root / self._metadata)

    def names(self) -> list[str]:
        """Return the names of all files of frames, in order."""
        folders = (self.root / name for name in ("rgbd", "rgb", "depth"))
        return sorted(
            f"{folder.name}/{path.name}" for folder in folders if folder.is_dir() for path in folder.iterdir()
        )

    def content(self, name: str, stream: str) -> bytes:
        """Return the bytes of a file. Raises Unusable naming the `stream`."""
        return file_bytes(self.root / name, stream)

    def path(self, name: str) -> Path | None:
        """Return the file on disk."""
        return self.root / name


class ArchivedRecording(Recording):
    """An .r3d file, read where it lies: nothing is unpacked to disk."""

    def __init__(self, path: Path) -> None:
        self.root = path
        self._file = opened(path, hint=AGAIN)
        try:
            with zip_errors(path, AGAIN):
                self._archive = zipfile.ZipFile(self._file)
        except BaseException:
            self._file.close()
            raise

    def metadata(self) -> Any:
        """Return the JSON document. Raises BadInput."""
        with zip_errors(self.root, AGAIN):
            try:
                data = self._archive.read(find_entry(self._archive, "metadata", LARGEST_METADATA))
            except KeyError:
                raise BadInput(f"{self.root}: holds no file `metadata`", hint=AGAIN) from None
        return json_of(data, f"{self.root}: metadata", hint=AGAIN)

    def names(self) -> list[str]:
        """Return the names of all files, in order."""
        return sorted(self._archive.NameToInfo)

    def content(self, name: str, stream: str) -> bytes:
        """Return the bytes of a file. Raises Unusable naming the `stream`."""
        try:
            with zip_errors(self.root, AGAIN):
                return self._archive.read(find_entry(self._archive, name, LARGEST_IMAGE_FILE))
        except BadInput as error:
            raise Unusable(f"unreadable_{stream}", error.message.removeprefix(f"{self.root}: ")) from None

    def close(self) -> None:
        """Close the archive."""
        self._archive.close()
        self._file.close()


def recording_at(path: Path) -> tuple[str, Path] | None:
    """Return the rule by which a path is a recording, and where it lies; None for something else."""
    if path.is_file():
        return ("file with the ending .r3d: Record3D", path) if path.suffix.lower() == ".r3d" else None
    for root in (path, path / "EXR_RGBD"):
        if (root / "rgbd").is_dir() and (root / "metadata").is_file():
            return "folder with metadata and rgbd/: Record3D", root
        if (root / "rgb").is_dir() and (root / "metadata.json").is_file() and _is_metadata(root / "metadata.json"):
            return "folder with metadata.json and rgb/: Record3D", root
    return None


def open_recording(root: Path) -> Recording:
    """Open what `recording_at` found. Raises BadInput for a broken archive."""
    if root.is_file():
        return ArchivedRecording(root)
    return FolderRecording(root, "metadata" if (root / "rgbd").is_dir() else "metadata.json")


def _is_metadata(path: Path) -> bool:
    try:
        document = read_json(path)
    except BadInput:
        return False
    return isinstance(document, dict) and {"K", "poses"} <= document.keys()
