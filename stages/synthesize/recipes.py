"""Room recipes (data/recipes/<name>.toml): the size and look of a room, and what stands where by which rule."""

from __future__ import annotations

import tomllib
from typing import Literal

from pydantic import Field, ValidationError
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput, UsageError, first_problem
from scenewright.schemas.places import REINSTALL, data_file

RECIPE_FOLDER = data_file("recipes")
"""What `--recipe` names lie here."""
CLUTTER_FACTOR = {"none": 0.0, "low": 0.5, "medium": 1.0, "high": 2.0}
"""By what `--clutter` multiplies the number of small things."""
Range = tuple[float, float]
Rgb = tuple[int, int, int]


class SeedSplit(Model):
    """Seeds [first, last] for choosing methods and constants, and those for reporting. They do not meet."""

    tuning: tuple[int, int]
    reporting: tuple[int, int]


class Shell(Model):
    """Floor, walls, ceiling."""

    width: Range
    """Along x [m]."""
    depth: Range
    """Along y [m]."""
    height: Range
    ceiling: bool = True
    floor_pattern: Literal["plain", "planks", "tiles", "carpet"] = "planks"
    floor_period: float = 0.14
    floor_colors: tuple[Rgb, ...]
    wall_colors: tuple[Rgb, ...]
    lamp_color: tuple[float, float, float] = (1.0, 0.93, 0.84)


class Place(Model):
    """One rule: how many objects of a class stand where."""

    class_name: str = Field(alias="class")
    where: Literal[
        "wall", "centre", "floor", "around", "front", "mounted", "on", "ceiling", "beside", "across", "leaning"
    ]
    """`wall`: back to a wall; `centre`: clear of the walls; `floor`: anywhere; `around`, `front`: at the sides or the
    front of `of`, facing it; `mounted`: hung on a wall; `on`: on a supporting surface of one of `of`; `ceiling`: hung
    from the ceiling, over one of `of` where that is given; `beside`: next to one of `of` of the same model, turned
    alike; `across`: on two of `of` that stand so; `leaning`: against a wall, or a side of one of `of`."""
    count: tuple[int, int] = (1, 1)
    """Least and most. Fewer than the least starts the room afresh."""
    of: tuple[str, ...] = ()
    """Classes that it stands at or on."""
    clutter: bool = False
    """Whether the count follows the clutter level."""
    room_in_front: float = 0.0
    """Free floor before the object's front [m]."""
    room_beside: float = 0.0
    """Free floor on at least one of its four sides, as deep as this [m]."""
    gap: Range = (0.02, 0.05)
    """To the wall, or from the edge of `of` [m]; negative pushes a chair under the table."""
    near: str | None = None
    """Prefer places close to objects of this class."""
    height: Range | None = None
    """`mounted`: height of the bottom [m]; `on`: allowed heights of the supporting surface."""
    surface: Literal["any", "inside", "top", "drawer"] = "any"
    """`drawer`: the floor of an open one."""
    style: tuple[str, ...] = ()
    """Only models of these styles (`style` of their generator)."""
    any_joint: bool = False
    """`open` moves any one of the joints, not the widest door."""
    front: Range = (0.0, 1.0)
    """`on`: where on the surface, from its front edge (0) to its back (1)."""
    side: Range = (0.0, 1.0)
    """`on`: where on the surface, from its left (0) to its right edge (1)."""
    spare: float = 0.012
    """`on`: distance to everything else [m]."""
    spare_beside: float = 0.0
    """`on`: free width on both sides for a gripper's fingers [m]."""
    spare_above: float = 0.0
    """`on`: free height above [m]."""
    yaw_spread: float = 0.0
    """Random turn to both sides [rad]."""
    open: Range | None = None
    """Share of the joint's range in which the widest door stands; closed when absent."""
    largest_extent: float | None = None
    """Only models whose closed box is not wider or deeper than this [m]."""
    largest_height: float | None = None
    smallest_height: float | None = None
    graspable: bool = False
    """Only models that a gripper can close on."""
    scale: Range = (1.0, 1.0)


class Recipe(Model):
    """One recipe file."""

    summary: str
    seeds: SeedSplit
    shell: Shell
    place: tuple[Place, ...]


def rescaled(recipe: Recipe, share: float) -> Recipe:
    """Return a recipe whose things are up to this share larger or smaller than by `recipe`, each by its own draw."""
    if not share:
        return recipe
    places = [
        rule.model_copy(update={"scale": (rule.scale[0] * (1.0 - share), rule.scale[1] * (1.0 + share))})
        for rule in recipe.place
    ]
    return recipe.model_copy(update={"place": tuple(places)})


def recipe_names() -> tuple[str, ...]:
    """Return the names of the recipes that ship."""
    return tuple(sorted(file.stem for file in RECIPE_FOLDER.glob("*.toml")))


def load_recipe(name: str) -> Recipe:
    """Read data/recipes/<name>.toml. Raises UsageError for an unknown name, BadInput for a broken file."""
    file = RECIPE_FOLDER / f"{name}.toml"
    if not file.is_file():
        raise UsageError(f"no room recipe {name!r}", hint=f"there are: {', '.join(recipe_names())}")
    try:
        with file.open("rb") as stream:
            return Recipe(**tomllib.load(stream))
    except ValidationError as error:
        raise BadInput(f"{file.name}: {first_problem(error)}", hint=REINSTALL) from None
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{file.name}: {error}", hint=REINSTALL) from None
