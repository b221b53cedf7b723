"""sha256 of files, folders and payloads."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path

from schemas.base import canonical_json
from schemas.errors import BadInput
from schemas.manifest import MANIFEST_NAME, FileRecord


def sha256_of_file(path: Path) -> str:
    """Return the hexadecimal sha256 of a file's bytes."""
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def sha256_of_text(text: str) -> str:
    """Return the hexadecimal sha256 of a text's UTF-8 bytes."""
    return hashlib.sha256(text.encode()).hexdigest()


def payload_files(root: Path) -> list[Path]:
    """Return every file under `root` but the manifest, sorted by POSIX path. Raises BadInput for links."""
    found = []
    for path in sorted(root.rglob("*"), key=lambda p: p.relative_to(root).as_posix()):
        if path.is_symlink():
            raise BadInput(f"{path}: a link inside an artifact", hint="artifacts hold plain files only")
        if path.is_file() and path != root / MANIFEST_NAME:
            found.append(path)
    return found


def record_files(root: Path, undigested: Sequence[str]) -> tuple[FileRecord, ...]:
    """Hash every payload file under `root`; names in `undigested` are recorded but stay out of the digest."""
    return tuple(
        FileRecord(
            path=(name := path.relative_to(root).as_posix()),
            bytes=path.stat().st_size,
            sha256=sha256_of_file(path),
            digested=name not in undigested,
        )
        for path in payload_files(root)
    )


def content_digest(records: Iterable[FileRecord]) -> str:
    """Return the sha256 over path, size and sha256 of the digested files, in path order."""
    rows = sorted([r.path, r.bytes, r.sha256] for r in records if r.digested)
    return sha256_of_text(canonical_json(rows))


def external_digest(path: Path) -> str:
    """Return the digest of a raw file, or of a folder's sorted files (hidden ones left out). Raises BadInput."""
    path = Path(path)
    if path.is_file():
        return sha256_of_file(path)
    if not path.is_dir():
        raise BadInput(f"{path}: no such file or folder", hint="check the path")
    rows = []
    for file in sorted(path.rglob("*"), key=lambda p: p.relative_to(path).as_posix()):
        relative = file.relative_to(path)
        if file.is_file() and not any(part.startswith(".") for part in relative.parts):
            rows.append([relative.as_posix(), file.stat().st_size, sha256_of_file(file)])
    return sha256_of_text(canonical_json(rows))
