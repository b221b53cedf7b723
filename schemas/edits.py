"""Edits by hand: `edits.toml`, what a person put right, anchored to geometry, and what became of it in an artifact.

An edit never names an instance or a node by its number: numbers change when a map is made anew with other parameters.
It says where the thing is (a box around it, a point on its surface) and what it was called.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum
from typing import Annotated, Literal

from pydantic import AfterValidator, Field
from scenewright.schemas.base import Model, Name
from scenewright.schemas.hand_written import Point, UprightBox
from scenewright.schemas.vocabulary import load_vocabulary

FORMAT = "scenewright-edits"
MOST_EDITS = 10_000
"""Most edits of a file; a bound, by eye."""
LONGEST_TEXT = 10_000
"""Longest name or note [letters]."""

Text = Annotated[str, Field(max_length=LONGEST_TEXT)]


class Asked(StrEnum):
    """How a page asks for a field, where the type alone does not say it."""

    PLACE = "place"
    """Where the middle of the thing's box goes."""
    DIRECTION = "direction"
    MODEL = "model"
    NOT = "not"
    """It is worked out from the rest."""


def _check_class(value: str) -> str:
    if not any(entry.name == value for entry in load_vocabulary().classes):
        raise ValueError(f"class {value!r:.60} is not in data/vocabulary.toml")
    return value


ClassName = Annotated[str, AfterValidator(_check_class)]


class Anchor(Model):
    """Which thing is meant: what a map held when somebody pointed at it."""

    class_name: ClassName = Field(alias="class")
    box: UprightBox
    """Around all of its surface, in the world frame."""
    point: Point
    """On its surface, far from whatever else is there [m]."""
    surface: tuple[Point, ...] = Field(default=(), max_length=64)
    """Points spread over its surface [m]; none where the box has to do: in a graph, and in what people write."""


class Edit(Model):
    """What all edits say."""

    by: Text = ""
    """Who made it."""
    when: str = Field(default="", pattern=r"^(\d{4}-\d{2}-\d{2}T\d{2}:\d{2}:\d{2}Z)?$")
    """Universal time."""
    note: Text = ""


class Rename(Edit):
    """The thing is of another class."""

    what: Literal["rename"]
    of: Anchor
    class_name: ClassName = Field(alias="class")


class Delete(Edit):
    """There is no such thing; its surface stays, without a name."""

    what: Literal["delete"]
    of: Anchor


class Merge(Edit):
    """These are one thing, of the class of the first one."""

    what: Literal["merge"]
    of: tuple[Anchor, ...] = Field(min_length=2, max_length=100)


class Split(Edit):
    """What of the thing's surface lies in the box is a thing of its own."""

    what: Literal["split"]
    of: Anchor
    part: UprightBox
    class_name: ClassName = Field(alias="class")
    """Of the part."""


class Add(Edit):
    """There is a thing in the box that the map does not name."""

    what: Literal["add"]
    box: UprightBox
    class_name: ClassName = Field(alias="class")
    surface: Literal["seen", "box"] = "seen"
    """`seen`: the surface in the box that nothing else owns. `box`: its six faces, for what no camera sees (glass)."""


class SetGravity(Edit):
    """These places lie on a surface that is level in truth: the map is turned until it is."""

    what: Literal["gravity"]
    level: tuple[Point, ...] = Field(min_length=3, max_length=64)
    """On the surface, not on one line [m]."""


class SetFloor(Edit):
    """The floor is level and as high as this place; other surface that is called floor is none."""

    what: Literal["floor"]
    at: Point


class Support(Edit):
    """What the thing stands on, in, at or below, whatever was measured."""

    what: Literal["support"]
    of: Anchor
    on: Anchor | None = None
    """None: nothing that the graph knows carries it."""
    relation: Literal["supports", "contains", "carries_on_wall", "hangs_from"] = "supports"
    """Of what carries it to the thing."""


class Mark(Edit):
    """Whether the thing is free to move, whatever its class says."""

    what: Literal["mark"]
    of: Anchor
    as_: Literal["fixed", "movable"] = Field(alias="as")


class ChooseModel(Edit):
    """Which CAD model stands for the thing."""

    what: Literal["model"]
    of: Anchor
    model: Annotated[Name | None, Asked.MODEL] = None
    """Of the scene or the library; None: none, its own mesh does."""


class Move(Edit):
    """Where the thing stands, and how it is turned."""

    what: Literal["move"]
    of: Anchor
    to: Annotated[Point, Asked.PLACE]
    """The middle of its box [m]."""
    heading_degrees: Annotated[float | None, Asked.NOT] = Field(default=None, ge=-360, le=360)
    """Of the x axis of its `model` about the vertical; None: as it is."""
    model: Annotated[Name | None, Asked.NOT] = None
    """What the heading is of: other models look another way."""
    turn_degrees: float = Field(default=0.0, ge=-360, le=360)
    """Of a thing with a mesh of its own: how far it is turned about the middle of its box."""
    carried: bool = False
    """Whether what it carries goes with it."""


class JointAnchor(Model):
    """Which joint of a thing is meant, by what it moves."""

    type: Literal["revolute", "prismatic"]
    axis: Point
    """Direction in the world; opening goes by it."""
    middle: Point
    """Of the box of the part that it moves, closed, in the world [m]."""


class SetJoint(Edit):
    """The thing's model is right in that this moves."""

    what: Literal["joint"]
    of: Anchor
    at: JointAnchor
    lower: float | None = Field(default=None, ge=-100, le=100)
    upper: float | None = Field(default=None, ge=-100, le=100)
    """Another range [rad, m]."""
    value: float | None = Field(default=None, ge=-100, le=100)
    """Where it stands."""


class RemoveJoint(Edit):
    """This does not move."""

    what: Literal["no_joint"]
    of: Anchor
    at: JointAnchor


class AddJoint(Edit):
    """What of the thing lies in the box moves, which its model or mesh does not say."""

    what: Literal["new_joint"]
    of: Anchor
    part: UprightBox
    type: Literal["revolute", "prismatic"]
    axis: Annotated[Point, Asked.DIRECTION]
    """Direction in the world; opening goes by it (right-handed)."""
    origin: Point
    """On the axis, in the world [m]."""
    lower: float = Field(default=0.0, ge=-100, le=100)
    upper: float = Field(ge=-100, le=100)
    """[rad, m]"""
    handle: Point | None = None
    """Where a hand takes hold of the part, closed, in the world [m]."""


MapEdit = Annotated[Rename | Delete | Merge | Split | Add | SetGravity | SetFloor, Field(discriminator="what")]
GraphEdit = Annotated[Support | Mark, Field(discriminator="what")]
SceneEdit = Annotated[ChooseModel | Move | SetJoint | RemoveJoint | AddJoint | Mark, Field(discriminator="what")]
AnyEdit = Annotated[
    Rename
    | Delete
    | Merge
    | Split
    | Add
    | SetGravity
    | SetFloor
    | Support
    | Mark
    | ChooseModel
    | Move
    | SetJoint
    | RemoveJoint
    | AddJoint,
    Field(discriminator="what"),
]
"""What a line of edits.toml may say. Each step applies the kinds that are its own and leaves the others."""


class EditsFile(Model):
    """edits.toml."""

    format: Literal["scenewright-edits"]
    version: Literal[1]
    edits: tuple[AnyEdit, ...] = Field(default=(), max_length=MOST_EDITS)


class AppliedEdit(Model):
    """What became of one edit."""

    number: int = Field(ge=1)
    """Its place in the file, from 1."""
    what: str
    status: Literal["applied", "already", "conflict"]
    """`already`: what it asks for is so without it. `conflict`: it was not applied, and `reason` says why."""
    things: tuple[str, ...] = ()
    """Nodes `<class>_<instance>` that it changed or made, as they are called after it."""
    reason: Text = ""
    by: Text = ""
    when: str = ""
    note: Text = ""


class AppliedEditsFile(Model):
    """edits.json of an edited artifact."""

    edits: tuple[AppliedEdit, ...]

    def conflicts(self) -> Iterator[AppliedEdit]:
        """Yield the edits that were not applied."""
        return (edit for edit in self.edits if edit.status == "conflict")
