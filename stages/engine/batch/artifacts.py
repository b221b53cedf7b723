"""What a scene has left on disk: digests, outcomes and figures, read from the manifests of its steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.schemas.evaluation import Evaluation, MetricsFile
from scenewright.schemas.manifest import Manifest
from scenewright.stages.engine.reading import check_sizes, read_manifest


def manifests(folder: Path, steps: Sequence[str]) -> dict[str, Manifest]:
    """Return step -> manifest of the artifacts that are there."""
    by_step = {}
    for step in steps:
        try:
            by_step[step] = read_manifest(folder / step)
        except BadInput:
            continue
    return by_step


def measures(folder: Path, found: dict[str, Manifest]) -> dict[str, float]:
    """Return `<step>/<measure>` -> finite figure of the evaluation artifacts; without any, of all summaries."""
    figures: dict[str, float | None] = {}
    for step, manifest in found.items():
        if manifest.kind == Evaluation.kind:
            try:
                metrics = MetricsFile.read(folder / step / "metrics.json").metrics
            except BadInput:
                continue
            figures |= {f"{step}/{name}": value for name, value in metrics.items()}
    if not figures:
        for step, manifest in found.items():
            figures |= {
                f"{step}/{name}": float(value)
                for name, value in manifest.summary.items()
                if isinstance(value, int | float) and not isinstance(value, bool)
            }
    return {name: value for name, value in figures.items() if value is not None and math.isfinite(value)}


def is_still_there(folder: Path, step: str, digest: str) -> bool:
    """Tell whether the artifact of `step` is whole (all files, with their sizes) and has the content it had."""
    try:
        manifest = read_manifest(folder / step)
        check_sizes(folder / step, manifest)
    except BadInput:
        return False
    return manifest.content_digest == digest
