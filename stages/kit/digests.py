"""sha256 of texts, files, and raw inputs (files and folders that no step wrote)."""

from __future__ import annotations

import errno
import hashlib
from pathlib import Path

from scenewright.schemas.base import canonical_json
from scenewright.schemas.errors import BadInput
from scenewright.schemas.manifest import LARGEST_MANIFEST, MANIFEST_NAME, Manifest
from scenewright.schemas.outside import opened


def sha256_of_file(path: Path) -> str:
    """Return the hexadecimal sha256 of a file's bytes. Raises BadInput when it cannot be read."""
    try:
        with opened(path, hint="check the file and its permissions") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        if error.errno == errno.EIO:
            raise  # the disk's fault, not the file's
        raise BadInput(f"{path}: {error.strerror}", hint="check the file and its permissions") from None


def sha256_of_text(text: str) -> str:
    """Return the hexadecimal sha256 of a text's UTF-8 bytes; file names that are no UTF-8 keep their own bytes."""
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()


def external_digest(path: Path) -> str:
    """Return the digest of a raw file, or of a folder's sorted files (hidden ones left out). Raises BadInput."""
    path = Path(path)
    try:
        is_file, is_folder = path.is_file(), path.is_dir()
    except (OSError, ValueError) as error:  # no permission, a name too long or with a zero byte
        raise BadInput(f"{path}: {getattr(error, 'strerror', None) or error}", hint="check the path") from None
    if is_file:
        return sha256_of_file(path)
    if not is_folder:
        raise BadInput(f"{path}: no such file or folder", hint="check the path")
    try:
        rows = [
            [file.relative_to(path).as_posix(), file.stat().st_size, sha256_of_file(file)]
            for file in external_files(path)
        ]
    except FileNotFoundError as error:
        raise BadInput(f"{error.filename}: is gone", hint="let nobody write to the folder meanwhile") from None
    return sha256_of_text(canonical_json(rows))


def external_files(path: Path) -> list[Path]:
    """Return the files of a raw input: itself, or a folder's sorted files without hidden ones.

    A folder that a step wrote (`export`) counts by its payload: its manifest and timings are new every time.
    """
    if not path.is_dir():
        return [path]
    passed_over = _bookkeeping(path)
    return [
        file
        for file in sorted(path.rglob("*"), key=lambda p: p.relative_to(path).as_posix())
        if file.is_file()
        and not any(part.startswith(".") for part in file.relative_to(path).parts)
        and file.relative_to(path).as_posix() not in passed_over
    ]


def _bookkeeping(folder: Path) -> set[str]:
    try:
        manifest = Manifest.read(folder / MANIFEST_NAME, largest=LARGEST_MANIFEST)
    except BadInput:
        return set()  # there is none, or it is not one of ours
    return {MANIFEST_NAME, *(record.path for record in manifest.files if not record.digested)}
