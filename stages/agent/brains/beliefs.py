"""What the `rules` brain believes: what calls returned, and nothing else."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

from scenewright.stages.agent.goals import FURNITURE, Among, Description, Gather, Goal, Move, Shut
from scenewright.stages.agent.language.values import SceneObject

MOST_FAILURES = 3
"""Failures of one step with one thing after which the thing is left alone."""


@dataclass(frozen=True)
class Style:
    """What the arm lets its brain do."""

    pictures: bool = False
    """Look at what will be grasped, what is held and what was placed, by a picture each (`thesis`)."""
    skilled: bool = False
    """Calls find base poses, repair and re-check by themselves and say why they failed (`ours`)."""
    rounds: int = 1
    """How often every place is looked at, from another side each, before something counts as not there."""
    thorough: int = 1
    """How often the places are looked at that all things of a kind are to be brought from."""


class Duty(IntEnum):
    """What comes before every goal, the most pressing first."""

    STEP_ASIDE = 1
    """Try the last call again from another base pose."""
    LOOK_AGAIN = 2
    PUT_BACK = 3
    """What is in the hand is not what was sought."""


class Asked(NamedTuple):
    """What the last program was about."""

    call: str = ""
    key: str = ""


class Check(NamedTuple):
    """What a picture has to show: the thing `thing` in the `hand`, on the `spot`, or in the `middle` of things."""

    where: str
    thing: SceneObject
    target: SceneObject


@dataclass
class Note:
    """What happened with one thing or one piece of furniture."""

    looked: int = 0
    """How often it was looked at."""
    failed: Counter[str] = field(default_factory=Counter)
    """Step -> how often it failed."""
    written: str = ""
    """The expression that a program names it by."""
    classes: set[str] = field(default_factory=set)
    """All that it looked like on maps."""
    rejected: bool = False
    """It is left alone."""
    unmoved: bool = False
    """It is left alone as the arm did not get it."""
    moved: bool = False
    """It was brought to where it belongs."""
    checked: bool = False
    """A picture of it was looked at."""
    doubted: str | None = None
    """What it looked like in the hand, where that was something else."""
    several: bool = False
    """It has several doors or drawers."""
    disputed: str | None = None
    """What it looks like from some sides, where that is not what is sought."""


@dataclass
class Beliefs:
    """The map, the robot, what went wrong, and what has to be done about it."""

    goals: tuple[Goal, ...]
    style: Style
    rooms: dict[str, SceneObject] = field(default_factory=dict)
    """Furniture by key."""
    explored: bool = False
    things: dict[str, SceneObject] = field(default_factory=dict)
    notes: defaultdict[str, Note] = field(default_factory=lambda: defaultdict(Note))
    handled: set[str] = field(default_factory=set)
    """Classes of things that were taken, which may be anywhere since."""
    lost: list[SceneObject] = field(default_factory=list)
    """Things that left the hand and were not seen again: nothing is done as long as one is missing."""
    at: str = ""
    """Key of the furniture that the robot stands before."""
    began: str = ""
    """Where it stood at first: what is said of no furniture is meant of this."""
    held: SceneObject | None = None
    asked: Asked = Asked()
    check: Check | None = None
    duties: set[Duty] = field(default_factory=set)
    troubles: int = 0

    def demand(self, duty: Duty, needed: bool = True) -> None:
        """Take up a duty, or drop it."""
        (self.duties.add if needed else self.duties.discard)(duty)

    def trouble(self, step: str, key: str) -> int:
        """Count a failure of a step of a thing; return how many of them there were."""
        self.troubles += 1
        self.notes[key].failed[step] += 1
        return self.notes[key].failed[step]

    def gave_up(self, key: str, *steps: str) -> bool:
        """Whether one of some steps failed so often that it is not tried again."""
        return any(self.notes[key].failed[step] >= MOST_FAILURES for step in steps)

    def map_name(self, place: str) -> str:
        """Return the variable that a program keeps what lies on a place in."""
        return f"on_{place}" if place in self.rooms else "here"

    def furniture(self, what: Description) -> list[str]:
        """Return the keys of the furniture of a description."""
        return [key for key, item in self.rooms.items() if item.label in what.labels]

    def able(self, what: Description) -> list[str]:
        """Return those of them that are not left alone."""
        return [key for key in self.furniture(what) if not self.notes[key].rejected]

    def fitting(self, what: Description) -> list[SceneObject]:
        """Return the things that are surely of a description, without those that are left alone."""
        fitting = [t for t in self.things.values() if fits(what, t)]
        return [t for t in fitting if not self.notes[t.key].rejected and t.doubt in ("", *what.labels)]

    def carrier(self, onto: Description) -> SceneObject | None:
        """Return what a thing is put on."""
        if onto.labels[0] in FURNITURE:
            return next((self.rooms[key] for key in self.able(onto)), None)
        return next(iter(self.fitting(onto)), None)

    def is_on(self, thing: SceneObject, onto: Description, how: str) -> bool:
        """Whether a thing is where it belongs; `how` is the call that brings it there."""
        if how == "place_among":
            return self.notes[thing.key].moved
        if onto.labels[0] in FURNITURE:
            room = self.rooms.get(thing.place)
            return room is not None and room.label in onto.labels
        carrier = self.things.get(thing.on)
        return carrier is not None and fits(onto, carrier)

    def may_be_other(self, thing: SceneObject, what: Description) -> bool:
        """Whether some view said that a thing is none of what is sought."""
        disputed = self.notes[thing.key].disputed
        return (thing.label if disputed is None else disputed) not in what.labels

    def anyway(self, thing: SceneObject, goal: Goal) -> bool:
        """Whether what may as well be of a kind as not is brought: where all are to be, unless another goal is about
        what else it may be."""
        if not (isinstance(goal, Move) and goal.every and thing.doubt):
            return False
        classes = {thing.label, thing.doubt}
        others = {label for g in self.goals if g is not goal for label in carried(g).labels}
        return bool(classes & set(goal.what.labels)) and not classes & others

    def either_way(self, thing: SceneObject, goal: Goal) -> bool:
        """Whether a goal has something brought that may be of one class or of another: it moves both, or all there are
        of the one."""
        labels = carried(goal).labels
        return (thing.label in labels and thing.doubt in labels) or self.anyway(thing, goal)

    def wanted_by(self, held: SceneObject) -> list[Goal]:
        """Return the goals that have brought what is in the hand."""
        looks = [(label, held.color, held.used) for label in {held.label, held.doubt}]
        return [goal for goal in self.goals if any(carried(goal).fits(*look) for look in looks)]

    def missed(self) -> list[SceneObject]:
        """Return the lost things without which a goal about all of a kind is not met."""
        return [t for t in self.lost for g in self.goals if of_all(g) and fits(carried(g), t)]

    def left_over(self, goal: Goal) -> str:
        """Say why a goal about all things of a kind is not known to be met: one was left alone, or may be of it."""
        if not of_all(goal) and not isinstance(goal, Among):
            return ""
        what = goal.around if isinstance(goal, Among) else carried(goal)
        for thing in self.things.values():
            if isinstance(goal, Move) and (
                (goal.start and thing.place not in self.furniture(Description((goal.start,))))
                or self.is_on(thing, goal.onto, "place")
            ):
                continue
            note = self.notes[thing.key]
            doubt = thing.doubt or (thing.label if note.doubted is None else note.doubted)
            if (thing.label in what.labels) != (doubt in what.labels):
                return f"{thing.key} may be a {thing.label} or a {doubt}"
            if not isinstance(goal, Among) and note.unmoved and fits(what, thing):
                return f"{thing.key} could not be moved"
        return ""


def fits(what: Description, thing: SceneObject) -> bool:
    """Whether a thing looks like what is described."""
    return what.fits(thing.label, thing.color, thing.used)


def carried(goal: Goal) -> Description:
    """Return what a goal has the robot carry; nothing for doors."""
    return Description(()) if isinstance(goal, Shut) else goal.what


def of_all(goal: Goal) -> bool:
    """Whether a goal is about everything of a kind."""
    return isinstance(goal, Gather) or (isinstance(goal, Move) and goal.every)
