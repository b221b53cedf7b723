"""What is wanted: the few forms that the words of a task come down to, for brains and for judges."""

from __future__ import annotations

from dataclasses import dataclass, field

FRUIT = ("apple", "banana", "orange", "lemon")
TOYS = ("doll", "teddy", "duck", "toy car")
CATEGORIES = {"fruit": FRUIT, "toy": TOYS}
"""What every child knows: a word for several classes."""
FURNITURE = (
    *("table", "bed", "sofa", "shelf", "fridge", "dresser", "desk", "cabinet"),
    *("drawer unit", "wardrobe", "chest", "chair", "stool", "bench", "trolley", "bin"),
)
BOXES = ("fruit box", "toy box")
CARRIERS = ("plate", "tray", *BOXES)
"""Small things on which others are put."""
SMALL = (*FRUIT, *TOYS, "cup", "bottle", "can", "spoon", "sponge")
THINGS = (
    *(*FRUIT, *TOYS, *CARRIERS, "cup", "bottle", "can", "spoon", "sponge", "book", "teapot", "bowl", "box"),
    *("jug", "kettle", "cooking pot", "pan", "vase", "keyboard", "mouse", "laptop", "remote", "toolbox", "backpack"),
)


@dataclass(frozen=True)
class Description:
    """Things that words may mean: any of the classes, of a colour where one is said, and clean where that is meant."""

    labels: tuple[str, ...]
    color: str = ""
    clean: bool = False

    def fits(self, label: str, color: str = "", used: bool | None = None) -> bool:
        """Whether something of this look may be meant; what cannot be told is no reason against it."""
        return label in self.labels and self.color in ("", color) and not (self.clean and used)

    @property
    def text(self) -> str:
        """As people say it."""
        name = next((word for word, labels in CATEGORIES.items() if labels == self.labels), " or ".join(self.labels))
        return " ".join(filter(None, ("clean" if self.clean else "", self.color, name)))


@dataclass(frozen=True)
class Move:
    """One of `what`, or every one that there is, onto `onto`; of those on or in furniture of class `start` if given."""

    what: Description
    onto: Description
    every: bool = False
    start: str = ""
    inside: bool = field(default=False, compare=False)
    """Words say that it goes in there, not on top."""


@dataclass(frozen=True)
class Among:
    """One of `what` into the middle of all of `around` on its table."""

    what: Description
    around: Description


@dataclass(frozen=True)
class Gather:
    """All of `what` on one and the same piece of furniture of class `onto`."""

    what: Description
    onto: Description


@dataclass(frozen=True)
class Shut:
    """The furniture of a class has its door closed, or open."""

    what: Description
    opened: bool = False


Goal = Move | Among | Gather | Shut
NEAR_MIDDLE = 0.12
"""How far from the mean of their positions the middle of things still is [m]."""


def kind(*labels: str, color: str = "", clean: bool = False) -> Description:
    """Return a description by classes or categories."""
    flat = tuple(c for label in labels for c in CATEGORIES.get(label, (label,)))
    return Description(flat, color, clean)


def descriptions(goal: Goal) -> tuple[Description, ...]:
    """Return all that a goal names."""
    match goal:
        case Move(what=what, onto=onto) | Gather(what=what, onto=onto):
            return (what, onto)
        case Among(what=what, around=around):
            return (what, around)
        case Shut(what=what):
            return (what,)


def sought(goals: tuple[Goal, ...]) -> tuple[str, ...]:
    """Return the classes of things that goals name, sorted: what an open-vocabulary detector is asked for."""
    labels = {label for goal in goals for each in descriptions(goal) for label in each.labels}
    return tuple(sorted(labels - set(FURNITURE)))
