"""Digests of artifacts: of every payload file, and of the whole."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from scenewright.schemas.base import canonical_json
from scenewright.schemas.errors import BadInput
from scenewright.schemas.manifest import MANIFEST_NAME, FileRecord
from scenewright.stages.kit.digests import sha256_of_file, sha256_of_text


def payload_files(root: Path) -> list[Path]:
    """Return every file under `root` but the manifest, sorted by POSIX path. Raises BadInput for links."""
    files = []
    for path in sorted(root.rglob("*"), key=lambda p: p.relative_to(root).as_posix()):
        if path.is_symlink():
            raise BadInput(f"{path}: a link inside an artifact", hint="artifacts hold plain files only")
        if path.is_file() and path != root / MANIFEST_NAME:
            files.append(path)
    return files


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
