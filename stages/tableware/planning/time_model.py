"""What actions cost, and what goes wrong in them: times and chances that were fitted to tables of the thesis.

A table is cleared in `trips x trip + stackings x stack + pulls x pull` seconds; a bin farther away adds its delay to
each trip twice. The file is written by
`scenewright train thesis-times`, which has the tables.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import pi, sqrt

import numpy as np
from pydantic import Field
from scenewright.schemas.base import Model
from scenewright.schemas.places import data_file
from scenewright.stages.tableware.options import THESIS_TIMES

FILE = data_file(THESIS_TIMES)
PLACEMENT_KINDS = ("cup", "bowl")


class Times(Model):
    """Seconds of a trip to the bin, of a stacking and of a pull."""

    trip: float = Field(gt=0.0)
    stack: float = Field(ge=0.0)
    pull: float = Field(ge=0.0)


class Drops(Model):
    """Chances that an action lets something fall off the table."""

    grasp: float = Field(ge=0.0, le=1.0)
    stack: float = Field(ge=0.0, le=1.0)
    pull: float = Field(ge=0.0, le=1.0)


class Fit(Model):
    """data/tableware/thesis_times.json."""

    source: str
    command: str
    times: dict[str, Times]
    """Tier -> its times; tier 3, which the thesis has not, takes those of tier 2."""
    hold: dict[str, float]
    """Letter of what a pile stands on -> chance that a multi-object grasp keeps the second of two such piles."""
    drops: Drops
    """As often as trials failed."""
    placement: dict[str, tuple[tuple[float, float], ...]]
    """Kind -> (length of a pull, mean distance of where the dish came to stand from where it should) [m]."""


@lru_cache(maxsize=1)
def thesis_fit() -> Fit:
    """Return the file's content."""
    return Fit.read(FILE)


@dataclass(frozen=True)
class TimeModel:
    """Seconds of a trip to the bin, of a stacking and of a pull, and of the way there and back to a farther bin."""

    trip: float
    stack: float
    pull: float
    delay: float = 0.0
    """Added to each trip twice."""

    @property
    def whole_trip(self) -> float:
        """Seconds of one trip with the delay both ways."""
        return self.trip + 2.0 * self.delay


def fitted(tier: str, delay: float = 0.0) -> TimeModel:
    """Return the time model of a tier."""
    times = thesis_fit().times["tier2" if tier == "tier3" else tier]
    return TimeModel(times.trip, times.stack, times.pull, delay)


def placement_error(kind: str, length: float, random: np.random.Generator) -> tuple[float, float]:
    """Draw by how much (x, y) [m] a pull over `length` [m] misses: Gaussian, the same in both directions, of the
    measured mean distance between its lengths; plates as bowls, utensils (not measured) as cups."""
    rows = thesis_fit().placement["bowl" if kind in ("bowl", "plate") else "cup"]
    mean = float(np.interp(length, [row[0] for row in rows], [row[1] for row in rows]))
    x, y = random.normal(0.0, mean / sqrt(pi / 2), size=2)
    return float(x), float(y)


@dataclass(frozen=True)
class Chances:
    """What goes wrong in the fast simulator. All arms live in the same world.

    hold: letters of what two piles stand on -> chance that a multi-object grasp keeps the second; else it stays.
    noise: whether pulls miss as measured. spills: whether the utensils on dishes that are lifted side by side stay on
    the table, as they do in physics, where the dishes hang by 20 degrees. drop_*: chance that an action lets something
    fall off the table, which is lost and a failure: grasps of one pile and of two, stackings, pulls of a dish that
    carries nothing and of one that does.
    """

    hold: Mapping[str, float] = field(default_factory=dict)
    noise: bool = False
    spills: bool = False
    drop_single: float = 0.0
    drop_two: float = 0.0
    drop_stack: float = 0.0
    drop_pull: float = 0.0
    drop_loaded_pull: float = 0.0

    @property
    def drops(self) -> bool:
        """Whether anything may fall off the table."""
        return any((self.drop_single, self.drop_two, self.drop_stack, self.drop_pull, self.drop_loaded_pull))

    @property
    def sure(self) -> bool:
        """Whether nothing slips or drops."""
        return not self.drops and all(chance >= 1.0 for chance in self.hold.values())

    def holds(self, first: str, second: str) -> float:
        """Return the chance for two piles by the letters of their lowest things; unlike ones as the worse of both."""
        return min(self.hold.get(first, 1.0), self.hold.get(second, 1.0))


EXACT = Chances()
"""Chances of a world in which everything goes as planned."""


def measured() -> Chances:
    """Return the thesis's world: pulls miss as measured, second piles slip as often as Pull's trips say."""
    return Chances(thesis_fit().hold, noise=True)


def with_thesis_failures() -> Chances:
    """Return the thesis's world, dropping as often as its trials failed."""
    drops = thesis_fit().drops
    return replace(
        measured(),
        drop_single=drops.grasp,
        drop_two=drops.grasp,
        drop_stack=drops.stack,
        drop_pull=drops.pull,
        drop_loaded_pull=drops.pull,
    )


def with_spills() -> Chances:
    """Return the thesis's world, in which utensils slide off dishes that are lifted side by side, as in physics."""
    return replace(measured(), spills=True)


WORLDS: dict[str, Callable[[], Chances]] = {
    "exact": lambda: EXACT,
    "thesis": measured,
    "thesis_spills": with_spills,
    "thesis_failures": with_thesis_failures,
}
"""What goes wrong, by the names of the command line."""
