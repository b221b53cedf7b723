"""Verifying artifacts: every byte re-hashed, every input followed back to the log."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from schemas.errors import BadInput, ScenewrightError
from schemas.manifest import MANIFEST_NAME, Manifest
from stages.engine.digests import content_digest, payload_files
from stages.engine.reading import check_sizes, check_version, read_manifest
from stages.engine.store import TIMINGS_NAME
from stages.kit.digests import external_digest, sha256_of_file


@dataclass(frozen=True)
class Finding:
    """One artifact's verdict. `problems` is empty when it is sound; `notes` tell what could not be checked."""

    path: Path
    kind: str
    problems: tuple[str, ...]
    notes: tuple[str, ...] = ()


def _check_bytes(root: Path, manifest: Manifest) -> list[str]:
    problems = []
    recorded = {record.path: record for record in manifest.files}
    for path in payload_files(root):
        if path.relative_to(root).as_posix() not in recorded:
            problems.append(f"{path}: not in the manifest")
    for record in manifest.files:
        if (root / record.path).is_file() and sha256_of_file(root / record.path) != record.sha256:
            problems.append(f"{root / record.path}: its bytes changed since it was written")
    if content_digest(manifest.files) != manifest.content_digest:
        problems.append(f"{root / MANIFEST_NAME}: content digest does not match its own file list")
    return problems


def _check_models(root: Path, manifest: Manifest) -> list[str]:
    problems = []
    if manifest.outcome == "ok":
        kind = check_version(root, manifest)
        optional = {name: model for name, model in kind.optional_json_files.items() if (root / name).exists()}
        for name, model in (kind.json_files | optional).items():
            try:
                model.read(root / name)
            except BadInput as error:
                problems.append(error.message)
    return problems


def verify(root: Path, seen: dict[Path, Finding] | None = None) -> list[Finding]:
    """Re-hash an artifact and follow its inputs back to the log. Returns one finding per artifact reached."""
    seen = {} if seen is None else seen
    root = Path(root).resolve()
    if root in seen:
        return []
    problems: list[str] = []
    notes: list[str] = []
    try:
        manifest = read_manifest(root)
        check_version(root, manifest)
    except ScenewrightError as error:
        seen[root] = Finding(root, "unknown", (str(error),))
        return [seen[root]]
    try:
        check_sizes(root, manifest)
    except BadInput as error:
        problems.append(str(error))
    else:
        problems += _check_bytes(root, manifest) + _check_models(root, manifest)
    findings: list[Finding] = []
    for record in manifest.inputs:
        source = (root / record.path).resolve()
        if not source.exists():
            notes.append(f"input {record.role} is no longer at {source}")
        elif record.kind == "external":
            if external_digest(source) != record.digest:
                problems.append(f"input {record.role} ({source}) is not what the artifact was made from")
            elif (source.parent / MANIFEST_NAME).exists():  # a payload file of an artifact, such as a generated log
                findings += verify(source.parent, seen)
            elif (source / TIMINGS_NAME).exists() and (source / MANIFEST_NAME).exists():  # a log that `export` wrote
                findings += verify(source, seen)
        else:
            try:
                digest = read_manifest(source).content_digest
            except ScenewrightError as error:
                problems.append(f"input {record.role}: {error}")
                continue
            if digest != record.digest:
                problems.append(f"input {record.role} ({source}) was made again with another result since")
            findings += verify(source, seen)
    seen[root] = Finding(root, manifest.kind, tuple(problems), tuple(notes))
    return [seen[root], *findings]
