"""Tableware on a table: kinds with their measures, items, and what stands on what.

World frame: origin in the middle of the table top, x along the 0.78 m side, y along the 0.61 m side, z up; metres and
radians. Radii, the utensils' greatest size and the table are Srinivas 2024, sections 5.2 and 7.1; heights, feet and
walls are ours, chosen so that three dishes of a kind fit between jaws 0.045 m high and four do not (section 6.4).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot
from typing import Literal

Kind = Literal["cup", "bowl", "plate", "fork", "spoon"]
DISHES: tuple[Kind, ...] = ("cup", "bowl", "plate")
UTENSILS: tuple[Kind, ...] = ("fork", "spoon")
TABLE_SIDES = (0.78, 0.61)
"""Extent of the workspace along x and y [m]."""


@dataclass(frozen=True)
class Measures:
    """Size of an item [m]. A dish is a tapered thin shell (its wall a cone from foot to rim, a flat floor); a utensil
    a bar that lies flat. What a kind does not have is 0."""

    height: float
    """Of a dish from table to lip; of a utensil its thickness."""
    rim_radius: float = 0.0
    """Outer radius at the lip."""
    foot_radius: float = 0.0
    """Outer radius at the table."""
    wall: float = 0.0
    """Wall and floor thickness, along the surface's normal."""
    length: float = 0.0
    width: float = 0.0

    @property
    def is_dish(self) -> bool:
        """Whether it is a round shell."""
        return self.rim_radius > 0.0

    @property
    def slant(self) -> float:
        """Length of the wall from foot to lip [m]."""
        return hypot(self.rim_radius - self.foot_radius, self.height)

    def outer_radius(self, height: float) -> float:
        """Return the outer radius [m] at `height` [m] above the foot."""
        return self.foot_radius + (self.rim_radius - self.foot_radius) * height / self.height

    def inner_radius(self, height: float) -> float:
        """Return the radius [m] of the hollow at `height` [m] above the foot."""
        return self.outer_radius(height) - self.wall * self.slant / self.height

    @property
    def nesting_rise(self) -> float:
        """How much higher [m] a dish stands in one like it than that one: walls in contact, or floor on floor."""
        return rise(self, self)


@dataclass(frozen=True)
class DishSizes:
    """What the things on a table measure, one size a kind; a kind that is None is not there and not looked for.

    Indexed by kind: `sizes["cup"]` raises KeyError for one that is not there.
    """

    cup: Measures | None = Measures(height=0.080, rim_radius=0.045, foot_radius=0.032, wall=0.0030)
    bowl: Measures | None = Measures(height=0.070, rim_radius=0.085, foot_radius=0.060, wall=0.0055)
    plate: Measures | None = Measures(height=0.022, rim_radius=0.110, foot_radius=0.070, wall=0.0050)
    fork: Measures | None = Measures(height=0.003, length=0.170, width=0.018)
    spoon: Measures | None = Measures(height=0.003, length=0.160, width=0.018)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_hash", hash((self.cup, self.bowl, self.plate, self.fork, self.spoon)))

    def __hash__(self) -> int:
        """Taken once: sizes are part of the key of everything that the planner remembers."""
        return self._hash  # type: ignore[attr-defined, no-any-return]

    def __getitem__(self, kind: str) -> Measures:
        measures = getattr(self, kind)
        if measures is None:
            raise KeyError(kind)
        return measures  # type: ignore[no-any-return]

    @cached_property
    def dishes(self) -> tuple[Kind, ...]:
        """The kinds of dishes that are there."""
        return tuple(kind for kind in DISHES if getattr(self, kind) is not None)

    @cached_property
    def utensils(self) -> tuple[Kind, ...]:
        """The kinds of utensils that are there."""
        return tuple(kind for kind in UTENSILS if getattr(self, kind) is not None)

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """All kinds that are there."""
        return (*self.dishes, *self.utensils)


STANDARD = DishSizes()
"""The sizes that everything rendered and simulated has where no file says otherwise."""


@dataclass(frozen=True)
class Item:
    """A thing on the table. `position`: foot centre of a dish, middle of the underside of a utensil, world [m]; `yaw`:
    of a utensil's long axis against x [rad]; `on`: name of what carries it, None for the table."""

    name: str
    kind: Kind
    position: tuple[float, float, float]
    yaw: float = 0.0
    on: str | None = None
    measures: Measures = Measures(0.0)

    @property
    def is_dish(self) -> bool:
        """Whether it is a cup, a bowl or a plate."""
        return self.kind in DISHES

    @property
    def lip(self) -> float:
        """World height [m] of its upper edge."""
        return self.position[2] + self.measures.height


def make_item(
    name: str,
    kind: Kind,
    x: float,
    y: float,
    yaw: float = 0.0,
    z: float = 0.0,
    on: str | None = None,
    sizes: DishSizes = STANDARD,
) -> Item:
    """Return an item that measures what its kind does."""
    return Item(name, kind, (x, y, z), yaw, on, sizes[kind])


FOOT_SHARE, WALL = 0.65, 0.004
"""Foot's radius over the rim's, and thickness of the wall [m]: assumed, as an image from above does not show them."""


def dish_measures(height: float, rim_radius: float) -> Measures:
    """Return the measures [m] of a dish of which only height and rim are known."""
    return Measures(
        height=height, rim_radius=rim_radius, foot_radius=FOOT_SHARE * rim_radius, wall=min(WALL, 0.3 * height)
    )


def rise(upper: Measures, lower: Measures) -> float:
    """Return how much higher [m] `upper` stands when put centred on or into `lower` than `lower` itself.

    Two dishes: both walls are cones, so the lowest height at which the upper's outer wall is nowhere wider than the
    lower's hollow is reached at the upper's foot, at one of the two lips, or on the floor. A utensil lies in a dish
    on its floor when its length fits the hollow there, else across the lip as far as this model goes.
    """
    if not lower.is_dish:
        return lower.height
    if not upper.is_dish:
        return lower.wall if upper.length <= 2.0 * lower.inner_radius(lower.wall) else lower.height
    slope = (lower.rim_radius - lower.foot_radius) / lower.height
    inner_foot = lower.inner_radius(0.0)
    hollow_at_lip = lower.inner_radius(lower.height)
    if upper.foot_radius > hollow_at_lip:
        return lower.height  # does not go in: stands on the lip
    heights = [lower.wall, (upper.foot_radius - inner_foot) / slope]
    if upper.rim_radius > hollow_at_lip:  # its wall crosses the level of the lower's lip, where it must fit
        taper = (upper.rim_radius - upper.foot_radius) / upper.height
        heights.append(lower.height - (hollow_at_lip - upper.foot_radius) / taper)
    else:  # its lip comes to lie within the lower's hollow or above it
        heights.append((upper.rim_radius - inner_foot) / slope - upper.height)
    return max(heights)


def radius(item: Item) -> float:
    """Return the radius that stacking goes by [m]: the rim's, and 0 for a utensil, which may lie on anything."""
    return item.measures.rim_radius


@dataclass(frozen=True)
class Table:
    """What is on the table. Items are told apart by name. `obstacles`: circles (x, y, radius) [m] of what is there, is
    not understood, and must not be touched."""

    items: tuple[Item, ...]
    obstacles: tuple[tuple[float, float, float], ...] = ()

    @cached_property
    def by_name(self) -> dict[str, Item]:
        """Name -> item."""
        return {item.name: item for item in self.items}

    @cached_property
    def carried(self) -> dict[str, tuple[Item, ...]]:
        """Name -> what stands directly on it."""
        above: dict[str, list[Item]] = {item.name: [] for item in self.items}
        for item in self.items:
            if item.on is not None:
                above[item.on].append(item)
        return {name: tuple(items) for name, items in above.items()}

    def load(self, name: str) -> tuple[Item, ...]:
        """Return everything above an item, lower things first."""
        carried: list[Item] = []
        waiting = [name]
        while waiting:
            above = self.carried[waiting.pop(0)]
            carried.extend(above)
            waiting.extend(item.name for item in above)
        return tuple(carried)

    @cached_property
    def stacks(self) -> tuple[tuple[Item, ...], ...]:
        """What stands on the table, each with everything above it, lower things first."""
        return tuple((item, *self.load(item.name)) for item in self.items if item.on is None)

    @cached_property
    def tops(self) -> tuple[Item, ...]:
        """Items that carry nothing."""
        return tuple(item for item in self.items if not self.carried[item.name])

    def without(self, names: frozenset[str] | set[str]) -> Table:
        """Return the table less some items. Raises ValueError when one of them carries an item that stays."""
        for item in self.items:
            if item.on in names and item.name not in names:
                raise ValueError(f"{item.name!r} stands on {item.on!r}, which would be taken away")
        return Table(tuple(item for item in self.items if item.name not in names), self.obstacles)

    def moved(self, name: str, x: float, y: float, on: str | None = None, yaw: float | None = None) -> Table:
        """Return the table after an item and its load went to (x, y) [m] on the table or onto `on`; loads keep their
        offsets, the item's height follows from what it stands on now."""
        item = self.by_name[name]
        z = 0.0 if on is None else stand_height(self, item, on)
        dx, dy, dz = x - item.position[0], y - item.position[1], z - item.position[2]
        going = {name, *(member.name for member in self.load(name))}
        items = []
        for member in self.items:
            if member.name not in going:
                items.append(member)
                continue
            position = (member.position[0] + dx, member.position[1] + dy, member.position[2] + dz)
            member = replace(member, position=position)
            if member.name == name:
                member = replace(member, on=on, yaw=member.yaw if yaw is None else yaw)
            items.append(member)
        return Table(tuple(items), self.obstacles)


def stand_height(table: Table, item: Item, on: str) -> float:
    """Return the world height [m] of an item's foot when it is put onto `on` or, where utensils lie there already,
    onto the highest of them."""
    base = table.by_name[on]
    lying = [loaded.lip for loaded in table.carried[on] if not loaded.is_dish and loaded.name != item.name]
    return max([base.position[2] + rise(item.measures, base.measures), *lying])
