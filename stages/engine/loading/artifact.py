"""What every loaded artifact has."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from schemas.artifact import Artifact
from schemas.errors import BadInput
from schemas.manifest import Manifest


class LoadedArtifact:
    """An artifact folder, open for reading. Nothing is read before it is asked for, and nothing is ever written."""

    def __init__(self, artifact: Artifact) -> None:
        assert artifact.manifest is not None
        self.path: Path = artifact.root
        self.manifest: Manifest = artifact.manifest
        """How it was made: stage, parameters, seed, inputs, versions, files."""

    @property
    def kind(self) -> str:
        """Kind of the artifact, such as `panoptic_map`."""
        return self.manifest.kind

    @property
    def outcome(self) -> str:
        """`ok`, or why not: `empty`, `infeasible`, `execution_failed`."""
        return self.manifest.outcome

    @property
    def summary(self) -> dict[str, Any]:
        """A handful of numbers that the step stated."""
        return dict(self.manifest.summary)

    @property
    def parameters(self) -> dict[str, Any]:
        """All parameters of the step, defaults included."""
        return dict(self.manifest.parameters)

    @property
    def inputs(self) -> dict[str, Path]:
        """Role -> where the input stood when this was made."""
        return {record.role: (self.path / record.path).resolve() for record in self.manifest.inputs}

    @property
    def files(self) -> tuple[str, ...]:
        """Payload files, by path within the folder."""
        return tuple(record.path for record in self.manifest.files)

    def file(self, name: str) -> Path:
        """Return the path of a payload file. Raises BadInput when the artifact has no such file."""
        if name not in self.files:
            raise BadInput(f"{self.path}: has no file {name!r}", hint=f"{len(self.files)} files are listed by .files")
        return self.path / name

    def __repr__(self) -> str:
        facts = ", ".join(f"{name} {value}" for name, value in list(self.summary.items())[:4])
        return f"<{self.kind} {self.path} {self.outcome}{': ' if facts else ''}{facts}>"
