"""What an artifact was made from, over as many steps as are there still."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

from scenewright.cli.viewing.inputs import input_artifact
from scenewright.schemas.artifact import Artifact

MOST_GENERATIONS = 20
"""Artifacts between one and what it was made from."""
Kind = TypeVar("Kind", bound=Artifact)


def before_edits(artifact: Artifact, edits: Path) -> Artifact:
    """Return what an artifact was before the edits of a file were applied to it, where that is there still."""
    for _ in range(MOST_GENERATIONS):
        inputs = artifact.manifest.inputs if artifact.manifest is not None else ()
        if not any((artifact.root / record.path).resolve() == edits.resolve() for record in inputs):
            return artifact
        artifact = input_artifact(artifact, type(artifact)) or artifact
    return artifact


def behind(artifact: Artifact, wanted: type[Kind]) -> Iterator[Kind]:
    """Yield the artifact of a kind that one is, or was made from, the nearest first, as far as they are there still."""
    waiting = [artifact]
    for _ in range(MOST_GENERATIONS):
        below: list[Artifact] = []
        for candidate in waiting:
            if isinstance(candidate, wanted):
                yield candidate
                continue
            source = input_artifact(candidate, wanted)
            if source is not None:
                yield source
                continue
            kinds = {record.kind for record in candidate.manifest.inputs} if candidate.manifest is not None else set()
            below += [
                input_of_kind for kind in sorted(kinds) if (input_of_kind := _input_of(candidate, kind)) is not None
            ]
        waiting = below


def _input_of(artifact: Artifact, kind: str) -> Artifact | None:
    from scenewright.schemas.kinds import KINDS

    return input_artifact(artifact, KINDS[kind]) if kind in KINDS else None
