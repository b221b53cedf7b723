"""What the robot perceives at one moment: the answers of the twelve perception calls."""

from __future__ import annotations

from dataclasses import dataclass

from scenewright.stages.kit.predicates.vocabulary import Vocabulary

TABLE_HEIGHT, TABLE_LEFT, TABLE_RIGHT = 0.0, -40.0, 25.0
"""Height of the table and its ends [units]."""
FINGER_HEIGHT, LARGEST_OPENING = 2.0, 5.0
"""Height of the fingers and largest gap between them [units]."""
TOLERANCE = 0.2
"""What `near` allows; it is that of the example which every learner is given."""
KITCHEN_WORDS = Vocabulary(
    of_object=("x", "y", "left", "right", "bottom", "top", "width", "height", "water"),
    of_scene=(
        "table_height",
        "table_left",
        "table_right",
        "gripper_x",
        "gripper_left",
        "gripper_right",
        "gripper_bottom",
        "gripper_top",
        "gripper_height",
        "gripper_mass",
        "gripper_opening",
        "largest_opening",
    ),
)


@dataclass(frozen=True)
class Seen:
    """One object: middle x, bottom y, width and height of its box, category, and water [tens of drops]."""

    x: float
    y: float
    width: float
    height: float
    category: str
    water: float = 0.0


@dataclass(frozen=True)
class State:
    """A moment; lengths in the kitchen's units."""

    objects: dict[str, Seen]
    gripper_x: float = 0.0
    gripper_y: float = 25.0
    """Of the fingers' tips."""
    opening: float = LARGEST_OPENING
    mass: float = 0.0
    """What the gripper feels in its fingers."""

    @property
    def names(self) -> tuple[str, ...]:
        """The objects."""
        return tuple(self.objects)

    @property
    def tolerance(self) -> float:
        """What `near` allows."""
        return TOLERANCE

    def category(self, name: str) -> str:
        """Return what kind of thing an object is."""
        return self.objects[name].category

    def related(self, relation: str, names: tuple[str, ...]) -> bool:
        """Nothing is perceived as a relation here."""
        raise KeyError(relation)

    def number(self, name: str, call: str) -> float:
        """Return what a perception call says of an object."""
        seen_object = self.objects[name]
        if call == "left":
            return seen_object.x - seen_object.width / 2
        if call == "right":
            return seen_object.x + seen_object.width / 2
        if call == "bottom":
            return seen_object.y
        if call == "top":
            return seen_object.y + seen_object.height
        return float(getattr(seen_object, call))

    def of_scene(self, call: str) -> float:
        """Return what a perception call says of the table or the gripper."""
        half = self.opening / 2
        return {
            "table_height": TABLE_HEIGHT,
            "table_left": TABLE_LEFT,
            "table_right": TABLE_RIGHT,
            "gripper_x": self.gripper_x,
            "gripper_left": self.gripper_x - half,
            "gripper_right": self.gripper_x + half,
            "gripper_bottom": self.gripper_y,
            "gripper_top": self.gripper_y + FINGER_HEIGHT,
            "gripper_height": FINGER_HEIGHT,
            "gripper_mass": self.mass,
            "gripper_opening": self.opening,
            "largest_opening": LARGEST_OPENING,
        }[call]
