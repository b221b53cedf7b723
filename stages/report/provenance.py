"""How the artifacts were made and what they cost, from their manifests."""

from __future__ import annotations

import json
import os
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from scenewright.schemas.artifact import Artifact
from scenewright.schemas.manifest import Manifest


@dataclass(frozen=True)
class Payload:
    """A file of an artifact, with a link relative to the report's folder."""

    name: str
    link: str
    size: str


@dataclass(frozen=True)
class Made:
    """One input of the report: what it is, how it was made, what it cost."""

    role: str
    kind: str
    outcome: str
    summary: tuple[tuple[str, str], ...]
    command: str
    stage: str
    seconds: float
    memory: float
    """Peak resident memory [MB]."""
    share: float
    """Of the slowest step's time, 0 to 1."""
    digest: str
    key: str
    seed: int
    parameters: str
    libraries: str
    environment: str
    commit: str
    files: tuple[Payload, ...]
    known: bool
    """False when the artifact came without a manifest."""


def made_of(artifacts: Mapping[str, Artifact], report_folder: Path) -> list[Made]:
    """Describe the artifacts by role. `report_folder`: where report.html will lie."""
    slowest = max((a.manifest.provenance.seconds for a in artifacts.values() if a.manifest is not None), default=0.0)
    return [_provenance_of(role, artifact, report_folder, slowest) for role, artifact in artifacts.items()]


def _provenance_of(role: str, artifact: Artifact, report_folder: Path, slowest: float) -> Made:
    manifest = artifact.manifest
    provenance = (manifest or _nothing(artifact)).provenance
    described = manifest or _nothing(artifact)
    return Made(
        role=role.replace("_", " "),
        kind=artifact.kind,
        outcome=described.outcome,
        summary=tuple((str(name), _short(value)) for name, value in described.summary.items()),
        command=shlex.join(_without_folders(provenance.command)),
        stage=f"{described.stage}, code {_code(described)}" if manifest else "",
        seconds=provenance.seconds,
        memory=provenance.peak_memory_bytes / 1e6,
        share=provenance.seconds / slowest if slowest else 0.0,
        digest=described.content_digest,
        key=described.key,
        seed=described.seed,
        parameters=json.dumps(described.parameters, sort_keys=True, ensure_ascii=False),
        libraries=", ".join(f"{name} {version}" for name, version in sorted(described.libraries.items())),
        environment=", ".join(t for t in (provenance.platform, f"Python {provenance.python}", provenance.device) if t),
        commit=provenance.git_commit[:12] + (" with local changes" if provenance.git_dirty else ""),
        files=_files(artifact, report_folder),
        known=manifest is not None,
    )


def _nothing(artifact: Artifact) -> Manifest:
    return Manifest(
        kind=artifact.kind,
        schema_version=artifact.schema_version,
        stage="",
        key="",
        content_digest="",
        files=(),
        outcome=artifact.outcome,
        summary=artifact.summary,
    )


def _code(manifest: Manifest) -> str:
    accepted = ", ".join(
        f"{entry.step} {entry.made_with:.12} as {entry.accepted:.12}" for entry in manifest.accepted_code
    )
    return f"{manifest.code[:12] or 'unknown'}{f' (accepted by hand: {accepted})' if accepted else ''}"


def _without_folders(command: tuple[str, ...]) -> list[str]:
    """The command as anyone would type it: absolute folders of this machine are cut off."""
    result = []
    for word in command:
        path = Path(word)
        result.append(os.path.join("…", *path.parts[-3:]) if path.is_absolute() and len(path.parts) > 3 else word)
    if result and Path(command[0]).name in ("__main__.py", "main.py"):
        result[0] = "scenewright"
    return result


def _files(artifact: Artifact, report_folder: Path, most: int = 12) -> tuple[Payload, ...]:
    if not artifact.root.is_dir():
        return ()
    base = os.path.relpath(artifact.root, report_folder)
    names = sorted(
        p for p in artifact.root.rglob("*") if p.is_file() and p.name not in ("manifest.json", "timings.json")
    )
    top = sorted(names, key=lambda p: (len(p.relative_to(artifact.root).parts), -p.stat().st_size))[:most]
    return tuple(
        Payload(
            # A name that is no UTF-8 is shown by its bytes (`\\xff`), and so linked.
            os.fsencode(p.relative_to(artifact.root)).decode("utf-8", "backslashreplace"),
            quote(os.fsencode(os.path.join(base, p.relative_to(artifact.root)))),
            _size(p.stat().st_size),
        )
        for p in top
    )


def _size(count: int) -> str:
    for unit, scale in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if count >= scale:
            return f"{count / scale:.1f} {unit}"
    return f"{count} B"


def _short(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 120 else text[:117] + "…"
