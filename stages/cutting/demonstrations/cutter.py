"""A scripted cutter in the place of people: it follows recipes with tilted planes, uneven spacing and its own order."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scenewright.stages.cutting.demonstrations.recipes import Category, Recipe, Split
from scenewright.stages.cutting.world.body import Body, Plane
from scenewright.stages.cutting.world.canonical import canonical
from scenewright.stages.cutting.world.knife import Knife, Refused, cut

ATTEMPTS = 8
"""Most attempts to place a plane that the knife cuts; by eye."""


@dataclass(frozen=True)
class Scatter:
    """How people miss what they aim at."""

    tilt: float = 0.07
    """Standard deviation of the plane's angle to the intended one, about either axis [rad]."""
    spacing: float = 0.12
    """Standard deviation of the plane's place, as a share of the part that it cuts off."""
    gap: tuple[float, float] = (0.002, 0.008)
    """Between the fragments afterwards [m]."""


@dataclass(frozen=True)
class Cut:
    """A plane through one piece, world frame, what came of it, and how far each result was pushed aside (3,) [m]."""

    piece: int
    plane: Plane
    results: tuple[int, ...]
    shifts: tuple[np.ndarray, ...]


@dataclass
class Demonstration:
    """Objects, cuts, and every piece there ever was, by number; the first are the objects."""

    cell: str
    families: tuple[str, ...]
    pieces: list[Body]
    cuts: list[Cut] = field(default_factory=list)
    categories: dict[int, Category] = field(default_factory=dict)
    """Of the fragments that were left as they are."""
    recipes: tuple[Recipe, ...] = ()
    """What the cutter had in mind: for the cutter alone."""
    finished: bool = True

    @property
    def objects(self) -> list[Body]:
        """What was there before any cut."""
        return self.pieces[: len(self.families)]

    @property
    def final(self) -> list[int]:
        """Numbers of the pieces that nobody cut."""
        gone = {cut.piece for cut in self.cuts}
        return [number for number in range(len(self.pieces)) if number not in gone]

    @property
    def fragments(self) -> list[Body]:
        """The pieces that nobody cut."""
        return [self.pieces[number] for number in self.final]

    def do(self, piece: int, plane: Plane, parts: list[Body], gap: float) -> list[int]:
        """Enter a cut; the parts are pushed apart by a gap [m]. Return their numbers."""
        shifts = [np.sign(plane.height(part.moments[0][None])[0]) * 0.5 * gap * plane.normal for part in parts]
        return self.enter(piece, plane, parts, shifts)

    def enter(self, piece: int, plane: Plane, parts: list[Body], shifts: list[np.ndarray]) -> list[int]:
        """Enter a cut whose parts are each pushed aside by (3,) [m]. Return their numbers."""
        numbers = tuple(range(len(self.pieces), len(self.pieces) + len(parts)))
        self.pieces += [part.shifted(shift) for part, shift in zip(parts, shifts, strict=True)]
        self.cuts.append(Cut(piece, plane, numbers, tuple(shifts)))
        return list(numbers)


@dataclass(frozen=True)
class _Task:
    """A piece that is still to become a run of parts of a split; directions of the object's axes in the columns."""

    piece: int
    axes: np.ndarray
    split: Split
    first: int
    last: int
    """Parts first to last - 1."""


def follow(
    cell: str,
    families: tuple[str, ...],
    objects: list[Body],
    recipes: tuple[Recipe, ...],
    random: np.random.Generator,
    *,
    scatter: Scatter | None = None,
    knife: Knife | None = None,
) -> Demonstration:
    """Return a demonstration: each object cut as its recipe says."""
    scatter, knife = scatter or Scatter(), knife or Knife()
    done = Demonstration(cell, families, list(objects), recipes=recipes)
    waiting: list[_Task] = []
    for number, (body, recipe) in enumerate(zip(objects, recipes, strict=True)):
        _hand_on(done, waiting, number, canonical(body).world_from_fragment[:3, :3], recipe)
    halving = random.random() < 0.5
    while waiting:
        task = waiting.pop(int(random.integers(len(waiting))))
        count = task.last - task.first
        first_parts = count // 2 if halving else (1 if random.random() < 0.5 else count - 1)
        numbers = _place(done, task, first_parts, random, scatter, knife)
        if numbers is None:
            _hand_on(done, waiting, task.piece, task.axes, task.split.below[task.first], stuck=True)
            continue
        below, above = numbers
        middle = task.first + first_parts
        for piece, first, last in ((below, task.first, middle), (above, middle, task.last)):
            if last - first == 1:
                _hand_on(done, waiting, piece, task.axes, task.split.below[first])
            else:
                waiting.append(_Task(piece, task.axes, task.split, first, last))
    return done


def _hand_on(
    done: Demonstration, waiting: list[_Task], piece: int, axes: np.ndarray, recipe: Recipe, *, stuck: bool = False
) -> None:
    while stuck and isinstance(recipe, Split):
        recipe = recipe.below[0]
    if isinstance(recipe, Split):
        waiting.append(_Task(piece, axes, recipe, 0, len(recipe.shares)))
    else:
        done.categories[piece] = recipe


def _place(
    done: Demonstration, task: _Task, parts: int, random: np.random.Generator, scatter: Scatter, knife: Knife
) -> tuple[int, int] | None:
    """Cut `parts` off the low end; return the larger pieces below and above the plane, None where no plane works."""
    body, axis = done.pieces[task.piece], task.axes[:, task.split.axis]
    low, high = body.extent_along(axis)
    shares = np.array(task.split.shares[task.first : task.last])
    aim = low + (high - low) * shares[:parts].sum() / shares.sum()
    smaller_part = (high - low) * min(shares[parts - 1], shares[parts]) / shares.sum()
    for _ in range(ATTEMPTS):
        position = aim + smaller_part * np.clip(random.normal(scale=scatter.spacing), -0.4, 0.4)
        lean = random.normal(scale=scatter.tilt, size=2)
        others = task.axes[:, [k for k in range(3) if k != task.split.axis]]
        normal = axis + others @ lean
        point = body.moments[0] + axis * (position - axis @ body.moments[0])
        plane = Plane.through(point, normal)
        try:
            results = cut(body, plane, knife)
        except Refused:
            continue
        numbers = done.do(task.piece, plane, results, float(random.uniform(*scatter.gap)))
        for number in numbers:
            done.categories[number] = _category(task.split)  # what falls off beside, and is not cut further
        sides = plane.height(np.array([body.moments[0] for body in results])) > 0
        below = [n for n, above in zip(numbers, sides, strict=True) if not above]
        above = [n for n, up in zip(numbers, sides, strict=True) if up]
        done.categories.pop(below[0])
        done.categories.pop(above[0])
        return below[0], above[0]
    return None


def _category(recipe: Recipe) -> Category:
    return recipe if not isinstance(recipe, Split) else _category(recipe.below[0])
