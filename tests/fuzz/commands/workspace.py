"""Where a case runs: its edited inputs, consistent by digest again, and what must not have changed afterwards."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from scenewright.schemas.artifact import KINDS
from scenewright.schemas.manifest import MANIFEST_NAME, FileRecord
from scenewright.stages.engine.digests import content_digest
from scenewright.stages.kit.digests import sha256_of_file

from tests.fuzz.commands.base import place_of
from tests.fuzz.commands.case import Case
from tests.fuzz.commands.edits import apply

OUT = "out"
Stamps = dict[str, tuple[int, int, int]]


def names_in(case: Case) -> list[str]:
    """Return the names of what a case reads, in the order of its words, then what it edits beside them."""
    words = [word[1:].split("/")[0] for word in case.words if word.startswith("@")]
    words += ["graph", "map", "segments"] if "@" in case.words else []  # the folder that they stand in
    return [name for name in dict.fromkeys([*words, *(edit.target for edit in case.edits)]) if name not in (OUT, "")]


def prepare(case: Case, base: Path, root: Path) -> list[str]:
    """Lay out what a case reads under `root`, edited, and return its command line.

    What is edited, and what was made from that, is copied and sealed again: manifests list the bytes that are there
    now, so that the edit passes every check of digests and reaches whoever works on it.
    """
    edited = list(dict.fromkeys(edit.target for edit in case.edits))
    digests: dict[str, str] = {}
    (root / "in").mkdir(parents=True)
    for name in edited:
        source, copy = place_of(base, name), root / "in" / name
        shutil.copytree(source, copy)
        for edit in [edit for edit in case.edits if edit.target == name and edit.file != MANIFEST_NAME]:
            apply(edit.how, copy / edit.file, edit.arguments)
        seal(copy, digests)
        for edit in [edit for edit in case.edits if edit.target == name and edit.file == MANIFEST_NAME]:
            apply(edit.how, copy / edit.file, edit.arguments)
    places = {name: root / "in" / name for name in edited}
    for name in names_in(case):
        source = place_of(base, name)
        if name in edited or not source.exists():
            continue
        if whole_copy(case) or (digests and reads_any(source, digests)):
            shutil.copytree(source, root / "in" / name)
            relink(root / "in" / name, digests)
            places[name] = root / "in" / name
    for name in edited:
        relink(root / "in" / name, digests)
    return [_word(word, places, base, root) for word in case.words]


def whole_copy(case: Case) -> bool:
    """Whether the command may change what it is given, as `gc --delete` does."""
    return case.words[0] in ("gc", "models")


def _word(word: str, places: dict[str, Path], base: Path, root: Path) -> str:
    if not word.startswith("@"):
        return word
    name, slash, rest = word[1:].partition("/")
    if name.partition(".")[0] == OUT:
        return str(root / name) + slash + rest
    if name == "":
        return str(root / "in")
    source = place_of(base, name)  # what is not there must not come to be there
    return str(places.get(name, source if source.exists() else root / name)) + slash + rest


def _manifest(folder: Path) -> dict[str, Any] | None:
    try:
        found = json.loads((folder / MANIFEST_NAME).read_text())
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) and isinstance(found.get("files"), list) else None


def seal(folder: Path, digests: dict[str, str]) -> None:
    """Let the manifest of an edited artifact list the files as they are; `digests` learns old -> new."""
    manifest = _manifest(folder)
    if manifest is None:
        return
    undigested = KINDS[manifest["kind"]].undigested
    records = []
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_file() and name != MANIFEST_NAME:
            digested = name not in undigested
            size = path.stat().st_size
            records.append(FileRecord(path=name, bytes=size, sha256=sha256_of_file(path), digested=digested))
    before = manifest["content_digest"]
    manifest["files"] = [record.model_dump() for record in records]
    manifest["content_digest"] = digests[before] = content_digest(records)
    (folder / MANIFEST_NAME).write_text(json.dumps(manifest))


def reads_any(folder: Path, digests: dict[str, str]) -> bool:
    """Whether an artifact was made from one of those."""
    manifest = _manifest(folder)
    return manifest is not None and any(entry["digest"] in digests for entry in manifest["inputs"])


def relink(folder: Path, digests: dict[str, str]) -> None:
    """Let an artifact name the new digests of its inputs."""
    manifest = _manifest(folder)
    if manifest is None or not isinstance(manifest.get("inputs"), list):
        return
    for entry in manifest["inputs"]:
        if isinstance(entry, dict) and isinstance(entry.get("digest"), str):
            entry["digest"] = digests.get(entry["digest"], entry["digest"])
    (folder / MANIFEST_NAME).write_text(json.dumps(manifest))


def stamps_of(folders: Iterable[Path]) -> Stamps:
    """Return inode, size and time of change of every file: what differs once somebody wrote there."""
    found: Stamps = {}
    for folder in folders:
        for parent, _, names in os.walk(folder):
            for name in names:
                if name.endswith(".lock"):
                    continue
                path = os.path.join(parent, name)
                status = os.lstat(path)
                found[path] = (status.st_ino, status.st_size, status.st_mtime_ns)
    return found


def digest_of(folder: Path) -> str:
    """Return a digest of all bytes under a folder."""
    found = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not path.name.endswith(".lock"):
            found.update(str(path.relative_to(folder)).encode("utf-8", "surrogateescape") + path.read_bytes())
    return found.hexdigest()
