"""The typed handle of an artifact folder, and how kinds are found by name."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Generic, Self, TypeVar, overload

from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput
from scenewright.schemas.manifest import Manifest
from scenewright.schemas.places import resolved

KINDS: dict[str, type[Artifact]] = {}
Content = TypeVar("Content", bound=Model)


class Document(Generic[Content]):
    """A JSON payload file of a kind, declared once: `info = Document(SegmentsFile, "segments.json")`.

    On a handle it is the parsed file, read and validated when it is first asked for (each time, as long as a step is
    still writing). Raises BadInput then.
    """

    def __init__(self, model: type[Content], name: str) -> None:
        self.model, self.name = model, name

    def __set_name__(self, owner: type, attribute: str) -> None:
        self.attribute = attribute

    @overload
    def __get__(self, artifact: None, owner: type) -> Self: ...
    @overload
    def __get__(self, artifact: Artifact, owner: type) -> Content: ...
    def __get__(self, artifact: Artifact | None, owner: type) -> Self | Content:
        if artifact is None:
            return self
        content = self.model.read(artifact.path(self.name))
        if artifact.manifest is not None:  # whole: what it holds is settled
            artifact.__dict__[self.attribute] = content  # where Python finds it before it asks here again
        return content


class OptionalDocument(Document[Content]):
    """A JSON payload file that an artifact of the kind may hold; None where it has none."""

    @overload  # type: ignore[override]
    def __get__(self, artifact: None, owner: type) -> Self: ...
    @overload
    def __get__(self, artifact: Artifact, owner: type) -> Content | None: ...
    def __get__(self, artifact: Artifact | None, owner: type) -> Self | Content | None:
        if artifact is not None and not artifact.path(self.name).is_file():
            return None
        return super().__get__(artifact, owner)  # type: ignore[arg-type, return-value]


@dataclass(frozen=True, repr=False)
class Artifact:
    """A folder with payload files of one kind.

    `run` of a step writes payload files under `root`, and returns the handle with the outcome and
    the handful of numbers that go into the manifest. When it is read as an input, `manifest` is set.

    A kind declares its JSON payload files as `Document`s; `info` is the main one.
    """

    kind: ClassVar[str] = ""
    schema_version: ClassVar[int] = 1
    description: ClassVar[str] = ""
    json_files: ClassVar[dict[str, type[Model]]] = {}
    """Payload JSON files that every artifact of this kind holds, with their models: its documents."""
    optional_json_files: ClassVar[dict[str, type[Model]]] = {}
    """Payload JSON files that an artifact of this kind may hold."""
    outside: ClassVar[str] = ""
    """Payload file that others write too: a folder that holds it and no manifest, or the file alone, is read in place
    of an artifact of this kind."""
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
        declared = [entry for base in reversed(cls.__mro__) for entry in vars(base).values()]
        documents = [entry for entry in declared if isinstance(entry, Document)]
        optional = {entry.name: entry.model for entry in documents if isinstance(entry, OptionalDocument)}
        cls.json_files = {entry.name: entry.model for entry in documents if entry.name not in optional}
        cls.optional_json_files = optional

    def path(self, name: str) -> Path:
        """Return the path of a payload file."""
        return self.root / name

    def pictures(self) -> tuple[int, float] | None:
        """Return the number of frames, and the megapixels of all of them; None for a kind without frames."""
        return None

    @property
    def files(self) -> tuple[str, ...]:
        """Payload files by path within the folder, as the manifest lists them; none before it is written."""
        return tuple(record.path for record in self.manifest.files) if self.manifest is not None else ()

    def file(self, name: str) -> Path:
        """Return the path of a payload file that the manifest lists. Raises BadInput when it lists none."""
        if name not in self.files:
            raise BadInput(f"{self.root}: has no file {name!r}", hint=f"{len(self.files)} files are listed by .files")
        return self.path(name)

    @property
    def parameters(self) -> dict[str, Any]:
        """All parameters of the step that made it, defaults included."""
        return dict(self.manifest.parameters) if self.manifest is not None else {}

    @property
    def inputs(self) -> dict[str, Path]:
        """Role -> where the input stood when this was made. Raises BadInput for what can be no place."""
        records = self.manifest.inputs if self.manifest is not None else ()
        try:
            return {record.role: resolved(self.root / record.path) for record in records}
        except (OSError, ValueError, RuntimeError) as error:
            raise BadInput(
                f"{self.root}: an input is named that can be nowhere: {error}", hint="make the artifact again"
            ) from None

    def __repr__(self) -> str:
        facts = ", ".join(f"{name} {value}" for name, value in list(self.summary.items())[:4])
        return f"<{self.kind} {self.root} {self.outcome}{': ' if facts else ''}{facts}>"
