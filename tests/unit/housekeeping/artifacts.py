"""Tiny artifacts with true manifests, made without any step."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from scenewright.schemas.evaluation import MetricsFile
from scenewright.schemas.kinds import KINDS
from scenewright.schemas.manifest import MANIFEST_NAME, InputRecord, Manifest, Provenance
from scenewright.stages.engine.digests import content_digest, record_files
from scenewright.stages.kit.digests import external_digest


def make_artifact(
    root: Path,
    kind: str = "trajectory",
    files: dict[str, str] | None = None,
    inputs: dict[str, Path] | None = None,
    provenance: dict[str, Any] | None = None,
    **fields: Any,
) -> Path:
    """Write an artifact: payload files, and inputs (role -> artifact folder or raw file) with their digests."""
    root.mkdir(parents=True)
    for name, text in (files or {"payload.txt": "payload"}).items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    records = record_files(root, KINDS[kind].undigested)
    listed = []
    for role, path in (inputs or {}).items():
        if (path / MANIFEST_NAME).is_file():
            manifest = Manifest.read(path / MANIFEST_NAME)
            listed.append((role, manifest.kind, manifest.content_digest, path))
        else:
            listed.append((role, "external", external_digest(path), path))
    defaults = {"stage": "probe", "schema_version": KINDS[kind].schema_version, "key": "k"}
    Manifest(
        kind=kind,
        files=records,
        content_digest=content_digest(records),
        inputs=tuple(
            InputRecord(role=role, kind=what, digest=digest, path=os.path.relpath(path, root))
            for role, what, digest, path in listed
        ),
        provenance=Provenance(**(provenance or {})),
        **(defaults | fields),
    ).write(root / MANIFEST_NAME)
    return root


def make_evaluation(root: Path, metrics: dict[str, float | None], **fields: Any) -> Path:
    """Write an evaluation with these measures."""
    text = MetricsFile(label="test", metrics=metrics).model_dump_json()
    return make_artifact(root, "evaluation", {"metrics.json": text}, **fields)


def snapshot(folder: Path) -> dict[str, tuple[int, int]]:
    """Return every path with its time and size."""
    return {str(p): (p.lstat().st_mtime_ns, p.lstat().st_size) for p in sorted(folder.rglob("*"))}
