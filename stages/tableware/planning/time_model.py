"""What actions cost, and what goes wrong in them, fitted to the thesis's tables (Srinivas 2024, tables 7.1 to 7.3).

A table is cleared in `trips x trip + stackings x stack + pulls x pull` seconds; a bin farther away adds its delay to
each trip twice (table 7.2). Trips follow from table 7.2 (ten more seconds a trip at 5 s delay), seconds from 7.1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import pi, sqrt

import numpy as np


@dataclass(frozen=True)
class Row:
    """Seconds without delay and with 5 s of it, of the thesis's three policies."""

    random: tuple[float, float]
    stack: tuple[float, float]
    pull: tuple[float, float]
    piles: int | None = None
    """Piles at the start; None: as many as Random's trips."""


TABLE_7_2: dict[str, Row] = {
    "tier0_cups": Row((78.2, 154.8), (58.5, 88.5), (48.8, 85.4), 6),
    "tier0_bowls": Row((63.3, 123.3), (60.2, 90.2), (41.3, 74.6), 6),
    "tier0_utensils": Row((64.1, 124.1), (64.3, 97.6), (55.3, 88.7), 6),
    "tier1": Row((121.3, 241.3), (111.3, 171.3), (102.1, 178.8), 12),
    "tier2": Row((93.5, 176.9), (88.2, 134.9), (84.2, 137.5)),
}


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


def trips_of(seconds: tuple[float, float]) -> float:
    """Return the trips that a row of table 7.2 implies: 5 s both ways are 10 s a trip."""
    return (seconds[1] - seconds[0]) / 10.0


def fitted(tier: str, delay: float = 0.0) -> TimeModel:
    """Return the time model of a tier, solved from its three rows; tier 3 has none and takes tier 2's.

    Every pile less than at the start that a policy carried away is one stacking, or one pull, more.
    """
    row = TABLE_7_2["tier2" if tier == "tier3" else tier]
    trip = row.random[0] / trips_of(row.random)
    piles = trips_of(row.random) if row.piles is None else row.piles

    def increment(seconds: tuple[float, float]) -> float:
        trips = trips_of(seconds)
        return (seconds[0] - trips * trip) / (piles - trips)

    return TimeModel(trip, increment(row.stack), increment(row.pull), delay)


TABLE_7_3: dict[str, tuple[tuple[float, float], ...]] = {
    "cup": ((0.20, 0.0028), (0.30, 0.0019), (0.40, 0.0018)),
    "bowl": ((0.20, 0.0092), (0.30, 0.0089), (0.40, 0.0076)),
}
"""Length of a pull -> mean distance of where the dish came to stand from where it should [m]."""


def placement_error(kind: str, length: float, random: np.random.Generator) -> tuple[float, float]:
    """Draw by how much (x, y) [m] a pull over `length` [m] misses: Gaussian, the same in both directions, of the mean
    distance of table 7.3 between its lengths; plates as bowls, utensils (not measured) as cups."""
    rows = TABLE_7_3["bowl" if kind in ("bowl", "plate") else "cup"]
    mean = float(np.interp(length, [row[0] for row in rows], [row[1] for row in rows]))
    x, y = random.normal(0.0, mean / sqrt(pi / 2), size=2)
    return float(x), float(y)


def expected_trips(count: int, hold: float) -> float:
    """Return how many trips `count` equal items take in pairs when the second stays behind with chance 1 - `hold`."""
    trips = [0.0, 1.0]
    for number in range(2, count + 1):
        trips.append(1.0 + hold * trips[number - 2] + (1.0 - hold) * trips[number - 1])
    return trips[count]


def fitted_hold(tier: str) -> float:
    """Return the chance that a multi-object grasp keeps its second pile, by which Pull's trips on a tier-0 row of the
    thesis come out."""
    trips = trips_of(TABLE_7_2[tier].pull)
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if expected_trips(6, middle) > trips else (low, middle)
    return (low + high) / 2


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


FAILED_TRIALS: dict[str, tuple[int, int, int]] = {
    "tier0_cups": (0, 0, 2), "tier0_bowls": (0, 0, 0), "tier0_utensils": (0, 0, 1), "tier1": (1, 2, 3),
    "tier2": (0, 2, 3),
}  # fmt: skip
"""Failed trials of three: Random, Stack, Pull (table 7.1)."""

EXACT = Chances()
"""Everything goes as planned."""


def measured() -> Chances:
    """Return the thesis's world: pulls miss as in table 7.3, second piles slip as often as Pull's trips say."""
    bowls = fitted_hold("tier0_bowls")
    hold = {"c": fitted_hold("tier0_cups"), "b": bowls, "p": bowls, "u": fitted_hold("tier0_utensils")}
    return Chances(hold, noise=True)


def with_thesis_failures() -> Chances:
    """Return the thesis's world, dropping as often as its trials failed: the chances of a grasp, a stacking and a pull
    by which the expected number of failed trials of table 7.1 comes out, grasps from Random's, the others from Stack's
    and Pull's. The thesis counts items left behind for want of perception among these, and so do we here."""
    single = _chance_of_failures(0, 0.0)
    stacking, pulling = _chance_of_failures(1, single), _chance_of_failures(2, single)
    return replace(
        measured(), drop_single=single, drop_two=single, drop_stack=stacking, drop_pull=pulling,
        drop_loaded_pull=pulling,
    )  # fmt: skip


def with_spills() -> Chances:
    """Return the thesis's world, in which utensils slide off dishes that are lifted side by side, as in physics."""
    return replace(measured(), spills=True)


def _chance_of_failures(policy: int, single: float) -> float:
    """Return the chance a stacking or a pull (Random: a grasp) fails with; grasps fail with `single`."""
    wanted = sum(failures[policy] for failures in FAILED_TRIALS.values())

    def expected(chance: float) -> float:
        total = 0.0
        for row in TABLE_7_2.values():
            trips = trips_of((row.random, row.stack, row.pull)[policy])
            others = (trips_of(row.random) if row.piles is None else row.piles) - trips if policy else 0.0
            grasp = single if policy else chance
            total += 3.0 * (1.0 - (1.0 - grasp) ** trips * (1.0 - chance) ** others)
        return total

    low, high = 0.0, 1.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if expected(middle) < wanted else (low, middle)
    return (low + high) / 2
