"""The typed handle of an artifact folder, and how kinds are found by name."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from schemas.base import Model
from schemas.manifest import Manifest

KINDS: dict[str, type[Artifact]] = {}


@dataclass(frozen=True)
class Artifact:
    """A folder with payload files of one kind.

    `run` of a step writes payload files under `root`, and returns the handle with the outcome and
    the handful of numbers that go into the manifest. When it is read as an input, `manifest` is set.
    """

    kind: ClassVar[str] = ""
    schema_version: ClassVar[int] = 1
    description: ClassVar[str] = ""
    json_files: ClassVar[dict[str, type[Model]]] = {}
    """Payload JSON files that every artifact of this kind holds, with their models."""
    optional_json_files: ClassVar[dict[str, type[Model]]] = {}
    """Payload JSON files that an artifact of this kind may hold."""
    undigested: ClassVar[tuple[str, ...]] = ("timings.json",)
    """Payload files that hold wall-clock figures and therefore are in no digest."""

    root: Path
    outcome: str = "ok"
    summary: dict[str, Any] = field(default_factory=dict)
    manifest: Manifest | None = None

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if cls.kind in KINDS:
            raise TypeError(f"artifact kind {cls.kind!r} is declared twice")
        KINDS[cls.kind] = cls

    def path(self, name: str) -> Path:
        """Return the path of a payload file."""
        return self.root / name
