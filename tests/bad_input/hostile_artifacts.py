"""Artifact folders that no step would write: their manifests say whatever a test wants."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from scenewright.stages.engine.digests import content_digest

NOTHING = content_digest(())
"""Digest of an artifact without files."""


def reads(*paths: str, kind: str = "trajectory") -> list[dict[str, str]]:
    """Return the records of inputs at these paths."""
    return [
        {"role": f"input_{number}", "kind": kind, "digest": NOTHING, "path": path} for number, path in enumerate(paths)
    ]


def artifact(path: Path, *inputs: str, **fields: Any) -> Path:
    """Write the manifest of an artifact without files that names these inputs."""
    path.mkdir(parents=True, exist_ok=True)
    document = {
        "kind": "trajectory",
        "schema_version": 1,
        "stage": "poses",
        "key": "k",
        "files": [],
        "content_digest": NOTHING,
        "inputs": reads(*inputs),
        "outcome": "empty",
        **fields,
    }
    (path / "manifest.json").write_text(json.dumps(document))
    return path


def cycle(folder: Path) -> Path:
    """Two artifacts, each made from the other."""
    artifact(folder / "second", "../first")
    return artifact(folder / "first", "../second")


def ladder(folder: Path, rungs: int) -> Path:
    """Artifacts that read the next one twice: 2^rungs ways lead to the last."""
    artifact(folder / f"rung_{rungs:02}")
    for rung in reversed(range(rungs)):
        artifact(folder / f"rung_{rung:02}", *[f"../rung_{rung + 1:02}"] * 2)
    return folder / "rung_00"


def chain(folder: Path, length: int) -> Path:
    """Artifacts each made from the next one."""
    for link in range(length):
        artifact(folder / f"link_{link:04}", *([f"../link_{link + 1:04}"] if link + 1 < length else []))
    return folder / "link_0000"
