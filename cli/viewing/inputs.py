"""Finding what an artifact was made from, for views that show both."""

from __future__ import annotations

from typing import TypeVar

from scenewright.schemas.artifact import Artifact
from scenewright.schemas.errors import BadInput
from scenewright.schemas.kinds import KINDS
from scenewright.stages.engine.reading import open_artifact

Kind = TypeVar("Kind", bound=Artifact)


def input_artifact(artifact: Artifact, kind: type[Kind]) -> Kind | None:
    """Return the input of this kind, or a subclass, where the manifest says it lies; None when it is not there."""
    if artifact.manifest is None:
        return None
    for record in artifact.manifest.inputs:
        if issubclass(KINDS.get(record.kind, Artifact), kind):
            try:
                candidate = open_artifact(artifact.root / record.path, kind)
            except BadInput:
                return None
            unchanged = candidate.manifest is not None and candidate.manifest.content_digest == record.digest
            return candidate if unchanged and isinstance(candidate, kind) else None
    return None
