"""Harder packing problems than the published ones; each is certified by a plan that the environment carries out.

An instance is made backwards: the basket is cut into cells by straight cuts, each cell is shrunk to a box (or to an
obstacle), and the boxes are set on the table. The cells, in some order, are a plan; an instance is kept only if that
plan reaches the goal with every motion feasible.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot, pi

import numpy as np
from scenewright.schemas.errors import UsageError
from scenewright.stages.pack.arm import Limits
from scenewright.stages.pack.environment import PackingWorld
from scenewright.stages.pack.instances import BASKETS, Instance, Obstacle, centred
from scenewright.stages.pack.loop import Budget, run_loop
from scenewright.stages.pack.motion import MotionPlanner
from scenewright.stages.pack.records import Action, BoxState, Observation, Rectangle
from scenewright.stages.pack.sampling import pick_and_place

STARTS = (
    (0.39, -0.12),
    (0.39, 0.12),
    (0.39, -0.36),
    (0.39, 0.36),
    (0.39, -0.6),
    (0.39, 0.6),
    (0.62, -0.36),
    (0.62, 0.36),
    (0.15, -0.5),
    (0.15, 0.5),
)
"""Places (x, y) at which boxes may start [m], far enough apart for the hand."""
CLEARANCE = 0.004
"""Boxes of the certificate stand at least this far apart [m]."""
SHORTEST, LONGEST = 0.03, 0.13
"""Shortest and longest side of a box [m]; by eye."""
ORDERS = 6
"""Orders in which the certificate is tried."""
TRIES = 200
"""Most tries to draw a problem that can be certified; by eye."""


@dataclass(frozen=True)
class Recipe:
    """What the instances of a cell have in common."""

    boxes: tuple[int, int]
    """Fewest and most."""
    fill: tuple[float, float]
    """Area of the boxes over the free area of the region that is cut."""
    basket: Rectangle = BASKETS["small"]
    depth: float = 1.0
    """Share of the basket, from the near edge, that is cut into cells."""
    obstacles: tuple[int, int] = (0, 0)
    heights: tuple[float, ...] = (0.07,)


FAR_BASKET = centred("basket", 0.79, 0.0, 0.38, 0.25)
"""Near edge at .60 m: less than the nearer half of it can be reached."""
HARD_CELLS: dict[str, Recipe] = {
    "fill": Recipe((4, 6), (0.62, 0.78)),
    "unreachable": Recipe((4, 5), (0.60, 0.72), FAR_BASKET, depth=0.70),
    "obstacles": Recipe((3, 5), (0.60, 0.72), BASKETS["medium"], depth=0.85, obstacles=(1, 2)),
    "mixed_heights": Recipe((5, 6), (0.60, 0.72), heights=(0.04, 0.07, 0.10, 0.13)),
    "boxes_6": Recipe((6, 6), (0.55, 0.62)),
    "boxes_8": Recipe((8, 8), (0.55, 0.62)),
    "boxes_10": Recipe((10, 10), (0.55, 0.62)),
}
"""Name of a suite -> how its problems are drawn."""
OBSTACLE_TOPS = (0.03, 0.10, 0.16)
"""Heights of obstacles [m]; by eye."""
COLORS = ("red", "blue", "green", "tan", "cyan", "yellow", "purple", "orange", "white", "brown")


class _Recited:
    """Proposes one plan."""

    name = "certificate"

    def __init__(self, plan: tuple[Action, ...]) -> None:
        self.calls, self._plan = 0, plan

    def propose(self, observation: Observation, trace: object) -> tuple[Action, ...]:
        self.calls += 1
        return self._plan


def hard_instance(cell: str, seed: int, limits: Limits = "fr3") -> Instance:
    """Return the instance of a cell and a seed with its certificate, which keeps the joint limits.

    Raises UsageError when none could be made.
    """
    recipe = HARD_CELLS[cell]
    random = np.random.default_rng([seed, 43, sorted(HARD_CELLS).index(cell)])
    planner = MotionPlanner(limits)  # one of its own: an instance does not depend on the seed of those who solve it
    try:
        for _ in range(TRIES):
            drawn = _draw(recipe, random)
            if drawn is None:
                continue
            boxes, obstacles, places = drawn
            instance = Instance(f"hard/{cell}/{seed}", boxes, recipe.basket, obstacles)
            certificate = _certify(instance, places, planner, random)
            if certificate is not None:
                return replace(instance, certificate=certificate)
    finally:
        planner.close()
    raise UsageError(
        f"hard/{cell}: number {seed} has no certified problem in {TRIES} tries", hint="choose another --instance"
    )


def _cut(region: np.ndarray, count: int, random: np.random.Generator) -> list[np.ndarray]:
    """Cut a rectangle (low x, low y, high x, high y) into `count` by straight cuts, the largest first."""
    cells = [region]
    while len(cells) < count:
        areas = [float((cell[2] - cell[0]) * (cell[3] - cell[1])) for cell in cells]
        cell = cells.pop(int(np.argmax(areas)))
        sides = cell[2:] - cell[:2]
        axis = int(sides[1] > sides[0]) if random.random() < 0.8 else int(random.integers(2))
        at = cell[axis] + sides[axis] * random.uniform(0.35, 0.65)
        first, second = cell.copy(), cell.copy()
        first[axis + 2], second[axis] = at, at
        cells += [first, second]
    return cells


def _draw(
    recipe: Recipe, random: np.random.Generator
) -> tuple[tuple[BoxState, ...], tuple[Obstacle, ...], tuple[tuple[float, float, float], ...]] | None:
    """Return boxes where they start, obstacles, and the place (x, y, yaw) of each box; None for an unlucky draw."""
    count = int(random.integers(recipe.boxes[0], recipe.boxes[1] + 1))
    blocked = int(random.integers(recipe.obstacles[0], recipe.obstacles[1] + 1))
    low, high = np.array(recipe.basket.low), np.array(recipe.basket.high)
    region = np.array([*low, low[0] + recipe.depth * (high[0] - low[0]), high[1]])
    cells = _cut(region, count + blocked, random)
    random.shuffle(cells)  # type: ignore[arg-type]
    obstacles = []
    for number, cell in enumerate(cells[:blocked]):
        low_x, low_y, high_x, high_y = (cell + CLEARANCE / 2 * np.array([1, 1, -1, -1])).round(4).tolist()
        top = OBSTACLE_TOPS[int(random.integers(len(OBSTACLE_TOPS)))]
        obstacles.append(Obstacle(Rectangle(f"post_{number + 1}", (low_x, low_y), (high_x, high_y)), top))
    cells = cells[blocked:]
    sides = np.array([cell[2:] - cell[:2] for cell in cells]) - CLEARANCE
    free = sum(float((cell[2] - cell[0]) * (cell[3] - cell[1])) for cell in cells)
    target_area = random.uniform(*recipe.fill) * free
    full = float(np.prod(sides, axis=1).sum())
    if full < target_area:
        return None
    sides = sides * np.sqrt(target_area / full)
    if sides.min() < SHORTEST or sides.max() > LONGEST:
        return None
    starts = random.permutation(len(STARTS))[:count]
    boxes, places = [], []
    for number, (cell, side) in enumerate(zip(cells, sides, strict=True)):
        turned = bool(random.integers(2))
        width, length = (side[::-1] if turned else side).round(4).tolist()
        height = recipe.heights[int(random.integers(len(recipe.heights)))]
        x, y = STARTS[int(starts[number])]
        start = (round(x + random.uniform(-0.005, 0.005), 6), round(y + random.uniform(-0.01, 0.01), 6))
        boxes.append(BoxState(f"{COLORS[number]}_box", width, length, height, *start, 0.0, False))
        middle = (cell[:2] + cell[2:]) / 2
        places.append((float(middle[0]), float(middle[1]), pi / 2 if turned else 0.0))
    return tuple(boxes), tuple(obstacles), tuple(places)


def _certify(
    instance: Instance,
    places: tuple[tuple[float, float, float], ...],
    planner: MotionPlanner,
    random: np.random.Generator,
) -> tuple[Action, ...] | None:
    """Return a plan over the places that reaches the goal, None when none of some orders does."""
    farthest_first = sorted(
        range(len(places)), key=lambda k: (instance.boxes[k].height, -hypot(places[k][0], places[k][1]))
    )
    with PackingWorld(instance, planner=planner) as world:
        for attempt in range(ORDERS):
            order = farthest_first if attempt == 0 else random.permutation(len(places)).tolist()
            plan = tuple(action for k in order for action in pick_and_place(instance.boxes[k].name, *places[k]))
            if run_loop(world, _Recited(plan), Budget(1)).success:
                return plan
    return None
