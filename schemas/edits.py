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

    by: Text = Field("", description="Who made it: an account's name where nobody says another.")
    when: str = Field(default="", pattern=r"^(\d{4}-\d{2}-\d{2}T\d{2}:\d{2}:\d{2}Z)?$")
    """Universal time."""
    note: Text = Field("", description="Why.")


class Rename(Edit):
    """The thing is of another class."""

    what: Literal["rename"]
    of: Anchor
    class_name: ClassName = Field(alias="class", description="A class of data/vocabulary.toml.")


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
    class_name: ClassName = Field(alias="class", description="Of the part: a class of data/vocabulary.toml.")


class Add(Edit):
    """There is a thing in the box that the map does not name."""

    what: Literal["add"]
    box: UprightBox
    class_name: ClassName = Field(alias="class", description="A class of data/vocabulary.toml.")
    surface: Literal["seen", "box"] = Field(
        "seen",
        description="`seen`: the surface in the box that nothing else owns. `box`: its six faces, for what no camera "
        "sees (glass).",
    )


class SetGravity(Edit):
    """These places lie on a surface that is level in truth: the map is turned until it is."""

    what: Literal["gravity"]
    level: tuple[Point, ...] = Field(
        min_length=3, max_length=64, description="On the surface, not on one line: x y z [m]."
    )


class SetFloor(Edit):
    """The floor is level and as high as this place; other surface that is called floor is none."""

    what: Literal["floor"]
    at: Point = Field(description="A place on the floor: x y z [m].")


class Support(Edit):
    """What the thing stands on, in, at or below, or that nothing carries it, whatever was measured."""

    what: Literal["support"]
    of: Anchor
    on: Anchor | None = Field(None, description="What carries it; nothing: nothing that the graph knows.")
    relation: Literal["supports", "contains", "carries_on_wall", "hangs_from"] = Field(
        "supports", description="What the carrier does."
    )


class Mark(Edit):
    """Whether the thing is free to move, whatever its class says."""

    what: Literal["mark"]
    of: Anchor
    as_: Literal["fixed", "movable"] = Field(alias="as", description="What it is.")


class ChooseModel(Edit):
    """Which CAD model stands for the thing, or that none does."""

    what: Literal["model"]
    of: Anchor
    model: Annotated[Name | None, Asked.MODEL] = Field(
        None, description="Id of a model of the scene or the library; none: its own mesh."
    )


class Move(Edit):
    """Where the thing stands, and how it is turned."""

    what: Literal["move"]
    of: Anchor
    to: Annotated[Point, Asked.PLACE] = Field(description="Where the middle of its box goes: x y z [m].")
    heading_degrees: Annotated[float | None, Asked.NOT] = Field(default=None, ge=-360, le=360)
    """Of the x axis of its `model` about the vertical; None: as it is."""
    model: Annotated[Name | None, Asked.NOT] = None
    """What the heading is of: other models look another way."""
    turn_degrees: float = Field(
        0.0, ge=-360, le=360, description="How far it turns about the vertical through the middle of its box [degrees]."
    )
    """Of a thing with a mesh of its own: of others the heading is kept."""
    carried: bool = Field(False, description="What it carries goes with it.")


class JointAnchor(Model):
    """Which joint of a thing is meant, by what it moves."""

    type: Literal["revolute", "prismatic"]
    axis: Point
    """Direction in the world; opening goes by it."""
    middle: Point
    """Of the box of the part that it moves, closed, in the world [m]."""


class SetJoint(Edit):
    """This joint moves, as the thing's model says."""

    what: Literal["joint"]
    of: Anchor
    at: JointAnchor
    lower: float | None = Field(None, ge=-100, le=100, description="Another least value [rad, m].")
    upper: float | None = Field(None, ge=-100, le=100, description="Another largest value [rad, m].")
    value: float | None = Field(None, ge=-100, le=100, description="Where it stands [rad, m].")


class RemoveJoint(Edit):
    """This joint does not move: its part stays where it is."""

    what: Literal["no_joint"]
    of: Anchor
    at: JointAnchor


class AddJoint(Edit):
    """What of the thing lies in the box moves, which its model or mesh does not say."""

    what: Literal["new_joint"]
    of: Anchor
    part: UprightBox
    type: Literal["revolute", "prismatic"] = Field(description="Whether it turns or slides.")
    axis: Annotated[Point, Asked.DIRECTION] = Field(
        description="Direction in the world that opening goes by (right-handed)."
    )
    origin: Point = Field(description="On the axis, in the world: x y z [m].")
    lower: float = Field(0.0, ge=-100, le=100, description="Least value [rad, m].")
    upper: float = Field(ge=-100, le=100, description="How far it opens [rad, m].")
    handle: Point | None = Field(
        None, description="Where a hand takes hold of the part, closed, in the world: x y z [m]."
    )


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
