"""Fits what actions cost, and what goes wrong in them, to the thesis's tables (Srinivas 2024, tables 7.1 to 7.3).

    scenewright train thesis-times --out FOLDER [--write]

A table is cleared in `trips x trip + stackings x stack + pulls x pull` seconds; a bin farther away adds its delay to
each trip twice (table 7.2). Trips follow from table 7.2 (ten more seconds a trip at 5 s delay), seconds from 7.1.
`--write` writes data/tableware/thesis_times.json, by which the product plans and simulates.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from scenewright.stages.tableware.planning.time_model import FILE, PLACEMENT_KINDS, Drops, Fit, Times
from scenewright.stages.tableware.training.thesis_times import TimesTraining
from scenewright.stages.tableware.training.thesis_times.printed import PRINTED

COMMAND = "scenewright train thesis-times"


@dataclass(frozen=True)
class Row:
    """Seconds without delay and with 5 s of it, of the thesis's three policies."""

    random: tuple[float, float]
    stack: tuple[float, float]
    pull: tuple[float, float]
    piles: int | None = None
    """Piles at the start; None: as many as Random's trips."""


PILES = {"tier0_cups": 6, "tier0_bowls": 6, "tier0_utensils": 6, "tier1": 12}
TABLE_7_2 = {
    tier: Row(*((row[0], row[2]) for row in rows.values()), piles=PILES.get(tier))  # type: ignore[misc, arg-type]
    for tier, rows in PRINTED.items()
}


def trips_of(seconds: tuple[float, float]) -> float:
    """Return the trips that a row of table 7.2 implies: 5 s both ways are 10 s a trip."""
    return (seconds[1] - seconds[0]) / 10.0


TABLE_7_3: dict[str, tuple[tuple[float, float], ...]] = {
    "cup": ((0.20, 0.0028), (0.30, 0.0019), (0.40, 0.0018)),
    "bowl": ((0.20, 0.0092), (0.30, 0.0089), (0.40, 0.0076)),
}
"""As printed: length of a pull -> mean distance of where the dish came to stand from where it should [m]."""


def times(tier: str) -> Times:
    """Return the seconds of a tier's actions, solved from its three rows.

    Every pile less than at the start that a policy carried away is one stacking, or one pull, more.
    """
    row = TABLE_7_2[tier]
    trip = row.random[0] / trips_of(row.random)
    piles = trips_of(row.random) if row.piles is None else row.piles

    def increment(seconds: tuple[float, float]) -> float:
        trips = trips_of(seconds)
        return (seconds[0] - trips * trip) / (piles - trips)

    return Times(trip=trip, stack=increment(row.stack), pull=increment(row.pull))


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


FAILED_TRIALS = {tier: tuple(row[4] for row in rows.values()) for tier, rows in PRINTED.items()}
"""Failed trials of three: Random, Stack, Pull (table 7.1)."""


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


def fit() -> Fit:
    """Return everything that is fitted. The thesis counts items left behind for want of perception among its failed
    trials, and so do the drops here: chances of a grasp, a stacking and a pull by which the expected number of failed
    trials comes out, grasps from Random's, the others from Stack's and Pull's."""
    single = _chance_of_failures(0, 0.0)
    bowls = fitted_hold("tier0_bowls")
    return Fit(
        source="Srinivas 2024, tables 7.1 to 7.3",
        command=COMMAND,
        times={tier: times(tier) for tier in TABLE_7_2},
        hold={"c": fitted_hold("tier0_cups"), "b": bowls, "p": bowls, "u": fitted_hold("tier0_utensils")},
        drops=Drops(grasp=single, stack=_chance_of_failures(1, single), pull=_chance_of_failures(2, single)),
        placement={kind: TABLE_7_3[kind] for kind in PLACEMENT_KINDS},
    )


def train(options: TimesTraining, out: Path) -> None:
    """Write the file."""
    fit().write(FILE if options.write else out / FILE.name)
