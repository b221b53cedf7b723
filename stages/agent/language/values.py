"""What programs of the plan language compute with: numbers, texts, things of a map, maps, outcomes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from scenewright.stages.kit.language.actions import quoted


@dataclass(frozen=True)
class SceneObject:
    """A thing or a piece of furniture as the arm's map has it."""

    key: str
    """`cup_0`: the class that the eyes said, and a number."""
    label: str
    place: str = ""
    """Key of the furniture that it is on or in; empty for furniture."""
    color: str = ""
    used: bool | None = None
    door: bool = False
    opened: bool = False
    top: bool = False
    """Of furniture with a door: things lie on its top as well. Of a thing: it lies on such a top."""
    more: bool = False
    """It has doors or drawers that were not opened yet."""
    on: str = ""
    """Key of the small carrier (plate, box) on which it lies."""
    doubt: str = ""
    """The class that it may as well be."""
    ahead: int = 0
    """By how many regions of views its class is ahead of any other, three at most."""

    @property
    def text(self) -> str:
        """As feedback says it."""
        look = [] if self.key.startswith(self.label.replace(" ", "_")) else [f"looks like a {self.label}"]
        look += [f"may be a {self.doubt}"] if self.doubt else []
        look += [self.color] if self.color else []
        look += [] if self.used is None else ["used" if self.used else "clean"]
        look += [] if not self.door else ["open" if self.opened else "closed"]
        where = f" on {self.on or self.place}" if self.place else ""
        return f"{quoted(self.key)}{f' ({chr(44).join(look)})' if look else ''}{where}"


@dataclass(frozen=True)
class ObjectMap:
    """Things by key, in the order in which they were found."""

    objects: tuple[SceneObject, ...] = ()

    def get(self, key: str) -> SceneObject | None:
        """Return the thing of a key, or None."""
        return next((item for item in self.objects if item.key == key), None)

    def find(self, label: str, color: str = "") -> tuple[SceneObject, ...]:
        """Return the things of a class, and of a colour where one is given."""
        return tuple(o for o in self.objects if o.label == label and color in ("", o.color))

    def __iter__(self) -> Iterator[SceneObject]:
        return iter(self.objects)

    @property
    def text(self) -> str:
        """As feedback says it."""
        return "; ".join(item.text for item in self.objects) or "nothing"


@dataclass(frozen=True)
class Outcome:
    """What an execution came to, as far as the arm can tell: a boolean, and from ours why."""

    ok: bool
    kind: str = ""
    """`unreachable`, `not_held`, `wrong_object`, `gone`, `not_there`, `no_way`, `closed`, ...; empty where nobody
    knows."""
    message: str = ""
    numbers: dict[str, float] = field(default_factory=dict)
    label: str = ""
    """What the thing turned out to look like, where it was about that."""

    @property
    def text(self) -> str:
        """As feedback says it."""
        return f"{self.ok}{f': {self.message}' if self.message else ''}"


@dataclass(frozen=True)
class Observation:
    """What the wrist camera saw, in words: a picture in the fast world."""

    subject: str
    """Key of what was looked at, or `hand`."""
    labels: tuple[str, ...]
    """Classes that are there."""
    used: bool | None = None

    @property
    def text(self) -> str:
        """As feedback says it."""
        labels_text = ", ".join(map(quoted, self.labels)) or "nothing"
        state = "" if self.used is None else f", {'used' if self.used else 'clean'}"
        return f"{'the hand holds' if self.subject == 'hand' else 'there is'} {labels_text}{state}"


Value = None | bool | int | float | str | SceneObject | ObjectMap | Outcome | Observation | tuple["Value", ...] | range


def as_text(value: Value) -> str:
    """Return a value as feedback says it."""
    if isinstance(value, SceneObject | ObjectMap | Outcome | Observation):
        return value.text
    if isinstance(value, tuple):
        return f"[{', '.join(map(as_text, value))}]"
    return quoted(value) if isinstance(value, str) else str(value)


def truth(value: Value) -> bool:
    """Return a value as a condition."""
    if isinstance(value, Outcome):
        return value.ok
    if isinstance(value, ObjectMap):
        return bool(value.objects)
    if isinstance(value, Observation):
        return bool(value.labels)
    return bool(value)
