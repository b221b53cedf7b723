"""Kind `learned_domain`: predicates and operators learned from corrections, with everything behind them."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model, Vector3

Name = Annotated[str, Field(min_length=1, max_length=200)]
Text = Annotated[str, Field(max_length=4000)]
Objects = Annotated[tuple[Name, ...], Field(max_length=2)]
AtomWords = Annotated[tuple[Name, ...], Field(min_length=1, max_length=4)]


class LearnedPredicate(Model):
    """A predicate as data: an expression over perception calls (docs/INTERPRET.md)."""

    name: Name
    arguments: int = Field(ge=0, le=2)
    means: Text
    said: Text
    """What it means, as a sentence."""


class LabelledExample(Model):
    """The predicate behind a phrase holds, or does not, for objects in a state."""

    state: int = Field(ge=0)
    objects: Objects
    holds: bool
    source: Text
    weight: float = Field(ge=0.0)
    turn: int = Field(ge=0)


class HeardPhrase(Model):
    """A correction without its objects, the predicate that it complains of, and the examples behind that."""

    text: Text
    arguments: int = Field(ge=0, le=2)
    predicate: Name
    examples: tuple[LabelledExample, ...]


class StatedPrecondition(Model):
    """What the teacher named for an action: place of the phrase, its variables, how often."""

    action: Name
    phrase: int = Field(ge=0)
    variables: Objects
    times: int = Field(ge=1)


class GoalMeaning(Model):
    """A part of a goal sentence, and what was missed of it: place of the phrase, which of the part's objects."""

    text: Text
    phrase: int = Field(ge=0)
    places: Annotated[tuple[int, ...], Field(max_length=2)]


class DoneAction(Model):
    """An action that was allowed and done, with the numbers of the states around it."""

    action: AtomWords
    before: int = Field(ge=0)
    after: int = Field(ge=0)


class SeenObject(Model):
    """What perception says of an object; lengths in the kitchen's units, water in tens of drops."""

    x: float
    y: float
    width: float = Field(gt=0.0)
    height: float = Field(gt=0.0)
    category: Name
    water: float = Field(ge=0.0)


class SeenState(Model):
    """A moment: objects, and what is felt of the gripper."""

    objects: dict[Name, SeenObject]
    gripper_x: float
    gripper_y: float
    opening: float
    mass: float


class SeenBody(Model):
    """What perception says of a body in a room (stages/kit/predicates/room.py). Metres, world frame."""

    middle: Vector3
    edges: Vector3
    width: float = Field(ge=0.0)
    depth: float = Field(ge=0.0)
    category: Name
    openness: float
    doors: int = Field(ge=0)
    surface: float = Field(ge=0.0)


class SeenRoom(Model):
    """A moment in a room: bodies, what carries or contains what, and what the hand holds."""

    bodies: dict[Name, SeenBody]
    supported: dict[Name, Name]
    contained: dict[Name, Name]
    held: str
    reach: tuple[float, float]
    hand_opening: float


class DialogueTurn(Model):
    """One line that teacher or robot said."""

    speaker: Name
    text: Text
    about: Text
    believed: bool


class LearnedDomainFile(Model):
    """domain.json."""

    domain: Name
    """Of the kitchen, or `room`."""
    setting: Literal["kitchen", "room"] = "kitchen"
    """The kitchen of blocks, or rooms of the chain."""
    teacher: Text
    learner: Text = "ours"
    """`ours`, `random`, or `thesis, <who answered>`."""
    predicates: Annotated[tuple[LearnedPredicate, ...], Field(max_length=200)]
    phrases: Annotated[tuple[HeardPhrase, ...], Field(max_length=200)]
    preconditions: tuple[StatedPrecondition, ...]
    goals: tuple[GoalMeaning, ...]
    transitions: tuple[DoneAction, ...]
    states: tuple[SeenState, ...]
    rooms: tuple[SeenRoom, ...] = ()
    """States, where the setting is a room."""
    dialogue: tuple[DialogueTurn, ...]
    disbelieved: tuple[Text, ...]
    sentences: int = Field(ge=0)
    questions: int = Field(ge=0)
    physics: tuple[Text, ...]
    """Actions that the teacher allowed and physics failed."""
    statement: Text


class LearnedDomain(Artifact):
    """`domain.json`, `domain.pddl` (the operators), `predicates.txt` and `predicates.png` (sentences, and where each
    predicate holds), `learning.png` (predicates, operators and sentences over the steps of training)."""

    kind: ClassVar[str] = "learned_domain"
    description: ClassVar[str] = "predicates and operators learned from corrections"
    undigested: ClassVar[tuple[str, ...]] = ("timings.json",)
    info = Document(LearnedDomainFile, "domain.json")
