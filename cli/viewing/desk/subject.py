"""What can be put right of an artifact: it is held as the edits leave it, as every edit is applied to what those before
it left, so that who clicks on a thing means it as it is now."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Generic, TypeVar

from scenewright.cli.edit_forms import WITHOUT
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.edits import Anchor, AnyEdit, AppliedEdit, Edit
from scenewright.schemas.errors import UsageError
from scenewright.stages.edit.anchoring import Fitting
from scenewright.stages.edit.applying import State, Table, apply_edits
from scenewright.stages.edit.map_state import Thing
from scenewright.stages.edit.parameters import EditMapParameters
from scenewright.stages.kit.viewing.canvas import Canvas

FITTING = Fitting(**EditMapParameters.model_validate({}).model_dump())
"""How edits are fitted, as the steps take it unless they are told otherwise."""
Held = TypeVar("Held", bound=State)


class Subject(ABC, Generic[Held]):
    """An artifact that edits are of, and what they come to."""

    all_edits: ClassVar[Table[Any]]
    option: ClassVar[str]
    """Of the step that applies them, as it is typed."""

    def __init__(self, artifact: Artifact, taken: frozenset[type[Edit]]) -> None:
        self.artifact = artifact
        self.table: Table[Held] = {kind: change for kind, change in self.all_edits.items() if kind not in taken}
        self.state = self.begun()
        self.first = {thing.name: thing.instance for thing in self.state.things()}
        """What things were called before all edits: what is shown may call them so still."""

    @abstractmethod
    def begun(self) -> Held:
        """Return the state before all edits."""

    @abstractmethod
    def draw(self, canvas: Canvas) -> None:
        """Draw it as the edits leave it."""

    @abstractmethod
    def anchor_of(self, thing: Thing) -> Anchor:
        """Return the anchor of a thing as it is now."""

    def restart(self) -> None:
        """Forget the edits."""
        self.state = self.begun()

    def apply(self, edits: Sequence[AnyEdit]) -> list[AppliedEdit]:
        """Apply edits to what those before them left."""
        return apply_edits(self.state, edits, FITTING, self.table)

    def thing(self, name: object) -> Thing:
        """Return the thing that is, or was called so, or has this number in its name. Raises UsageError."""
        names = {thing.name: thing.instance for thing in self.state.things()}
        numbered = [instance for full, instance in names.items() if full.rpartition("_")[2] == name]
        called = names.get(str(name), self.first.get(str(name), numbered[0] if len(numbered) == 1 else None))
        if called is None:
            shown = ", ".join(list(names)[:12]) + (", ..." if len(names) > 12 else "")
            many = "more than one thing" if numbered else "no thing"
            raise UsageError(f"{self.artifact.root}: has {many} {str(name)!r:.80}", hint=f"it has: {shown or 'none'}")
        match = next((thing for thing in self.state.things() if thing.instance == called), None)
        if match is None:
            raise UsageError(f"{name} is not there any more: an edit took it away", hint="delete that edit first")
        return match

    def fields(self, what: str, form: Sequence[Mapping[str, Any]], asked: Mapping[str, Any]) -> dict[str, Any]:
        """Return the fields of an edit out of what somebody asks for, where things are named. Raises UsageError."""
        values: dict[str, Any] = {"what": what}
        for field in form:
            name, kind, value = field["name"], field["kind"], asked.get(field["name"])
            if value is None or (value == WITHOUT.get(kind) and value in field.get("choices", ())):
                continue
            if kind == "thing" and value not in field.get("choices", ()):
                value = self._anchor_fields(self.thing(value))
            elif kind == "things" and isinstance(value, list):
                things = {thing.instance: thing for thing in map(self.thing, value)}
                if len(things) < field["fewest"]:
                    raise UsageError(f"edit {what}: takes at least {field['fewest']} things", hint="name other ones")
                value = [self._anchor_fields(thing) for thing in things.values()]
            values[name] = value
        return values

    def _anchor_fields(self, thing: Thing) -> dict[str, Any]:
        return self.anchor_of(thing).model_dump(mode="json", by_alias=True)

    def facts(self) -> dict[str, Any]:
        """Return what a page asks for edits with, as JSON: `things`, by name, and `models`."""
        return {"things": {}, "models": []}

    def command(self) -> str:
        """Return the command that applies the edits, without their file."""
        return f"scenewright edit {self.option} {self.artifact.root}"
