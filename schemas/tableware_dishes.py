"""What the dishes of a user and the gripper measure: the file behind `--dishes`, kept in what was made with it."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator
from scenewright.schemas.base import Model


def _between(low: float, high: float, description: str) -> object:
    return Field(ge=low, le=high, description=description)


class DishSize(Model):
    """A round dish [m]: a wall that is a cone from foot to rim, and a flat floor."""

    height: Annotated[float, _between(0.008, 0.15, "from the table to the lip")]
    rim_radius: Annotated[float, _between(0.02, 0.16, "outer, at the lip")]
    foot_radius: Annotated[float, _between(0.01, 0.16, "outer, at the table")] | None = None
    """Without it 0.65 of the rim's is taken, and nothing is stacked."""
    wall: Annotated[float, _between(0.0005, 0.015, "thickness of wall and floor")] | None = None
    """Without it 4 mm are taken, and nothing is stacked."""

    @model_validator(mode="after")
    def _is_a_dish(self) -> DishSize:
        if self.foot_radius is not None and self.foot_radius > self.rim_radius:
            raise ValueError("the foot is wider than the rim: such a dish is not known how to be held")
        if self.wall is not None and self.wall > 0.4 * min(self.height, self.rim_radius):
            raise ValueError("the wall is thicker than the dish is hollow")
        return self


class UtensilSize(Model):
    """A fork or a spoon [m]."""

    length: Annotated[float, _between(0.10, 0.24, "from end to end")]
    width: Annotated[float, _between(0.008, 0.028, "of the head")]
    thickness: Annotated[float, _between(0.001, 0.010, "of the strip")] = 0.003


class GripperSize(Model):
    """A hand with two parallel jaws [m]."""

    opening: Annotated[float, _between(0.03, 0.25, "between the open pads")]
    jaw_height: Annotated[float, _between(0.010, 0.12, "of what the pads hold at once, along the fingers")]
    finger_width: Annotated[float, _between(0.004, 0.06, "of a finger, across the closing direction")]


class TablewareDishes(Model):
    """dishes.toml: a table for each kind that is on the table, and one for the gripper. A kind without a table is not
    looked for; without any, the standard sizes hold, without `gripper` the standard hand."""

    cup: DishSize | None = None
    bowl: DishSize | None = None
    plate: DishSize | None = None
    fork: UtensilSize | None = None
    spoon: UtensilSize | None = None
    gripper: GripperSize | None = None

    @model_validator(mode="after")
    def _can_be_told_apart(self) -> TablewareDishes:
        dishes = [(name, dish) for name in ("cup", "bowl", "plate") if (dish := getattr(self, name)) is not None]
        for (name, dish), (other_name, smaller) in zip(dishes, dishes[1:], strict=False):
            if dish.rim_radius >= smaller.rim_radius:
                raise ValueError(f"a {name} is narrower than a {other_name}: name them by their width")
        if (self.fork is None) != (self.spoon is None):
            raise ValueError("fork and spoon are told apart by their outlines: give the sizes of both, or of neither")
        if not dishes and self.fork is None and self.gripper is None:
            raise ValueError("it says nothing: give [cup], [bowl], [plate], [fork] with [spoon], or [gripper]")
        return self

    @property
    def has_sizes(self) -> bool:
        """Whether it says what is on the table."""
        return any(getattr(self, name) is not None for name in ("cup", "bowl", "plate", "fork"))
