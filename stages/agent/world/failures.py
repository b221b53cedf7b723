"""What goes wrong and how often: the thesis's failure table as rates, drawn once for good per cause and place.

Table 3.4 (Han 2024) counts 52 failures within 262 executions (140 tabletop, 122 mobile), without saying what the 262
were. **Assumed**: at a table every second execution is a grasp, every other a place; on the move one of four is a
grasp, one a place, two are drives. Of failed grasps three quarters are bad base poses ("primarily" in 3.4.3), the
others slips. A motion that cannot be planned is noticed by the boolean of an action, a slip is not (3.3.3: `grasp`
answers whether a grasp was planned and executed). Half of the bad base poses could be foreseen by a reachability
check in the map.

A draw is a number of the cause and of what it belongs to, not of time: the same thing tried again fails again, until
something that the cause hangs on has changed (another base, another grasp, the thing moved, another view).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from scenewright.stages.kit.acting.errors import SegmenterRates, segmenter_rates

EXECUTIONS = 262
"""Executions that table 3.4 counts."""
GRASPS = 140 / 2 + 122 / 4
"""Executions that grasp, as assumed above."""
OTHERS_IN_VIEW = 5
"""**Assumed**: things beside a sought one, each of which may be taken for it."""
PLACES = 140 / 2 + 122 / 4
"""Executions that place, as assumed above."""
DRIVES = 122 / 2
"""Executions that drive, as assumed above."""
CHECKS = GRASPS + PLACES
"""Executions of which an image was looked at afterwards."""
TABLE_3_4 = {
    "false_positive": (3, 5),
    "missed": (1, 1),
    "feedback": (2, 1),
    "api": (3, 5),
    "grasp": (1, 17),
    "place": (3, 3),
    "navigation": (1, 0),
}
"""Cause -> failures that led to the failure of the task, recovered ones, as printed (rows of recovered sum to 32)."""
COUNTS = {"false_positive": 8, "missed": 2, "feedback": 3, "api": 8, "grasp": 24, "place": 6, "navigation": 1}
"""The printed totals."""


@dataclass(frozen=True)
class PrintedEyes:
    """What table 3.4 says of the eyes, as rates of sights."""

    missed: float = COUNTS["missed"] / GRASPS
    wrong_name: float = COUNTS["false_positive"] / GRASPS / OTHERS_IN_VIEW
    passed_both: float = 3 / 8
    """Three of eight false detections passed the look from near by and led to failure."""

    @property
    def other_region(self) -> float:
        """Correlation of two wrong names from two regions of views."""
        return (self.passed_both - self.wrong_name) / (1 - self.wrong_name)


@dataclass(frozen=True)
class Rates:
    """Chances, each per draw. `base`, `slip` of a grasp; `shut`, `roll` of a place (no trajectory; rolls off)."""

    eyes: SegmenterRates = field(default_factory=lambda: segmenter_rates("thesis"))
    """Of what is missed or taken for something else."""
    feedback: float = COUNTS["feedback"] / CHECKS
    """That one view of an outcome is misjudged."""
    api: float = COUNTS["api"] / EXECUTIONS
    """That a call is written down wrongly. Of the `rules` brain; a language model makes its own mistakes."""
    base: float = 0.75 * COUNTS["grasp"] / GRASPS
    slip: float = 0.25 * COUNTS["grasp"] / GRASPS
    shut: float = 0.5 * COUNTS["place"] / PLACES
    roll: float = 0.5 * COUNTS["place"] / PLACES
    navigation: float = COUNTS["navigation"] / DRIVES
    foreseen: float = 0.5
    """Share of bad base poses that a reachability check in the map would tell."""

    def scaled(self, execution: float, perception: float) -> Rates:
        """Return the rates with those of execution (and the brain's) and those of perception multiplied."""

        def times(factor: float, *names: str) -> dict[str, float]:
            return {name: min(1.0, factor * getattr(self, name)) for name in names}

        acted = times(execution, "api", "base", "slip", "shut", "roll", "navigation")
        return replace(self, **acted, **times(perception, "feedback"), eyes=self.eyes.times(perception))

    def with_true_eyes(self) -> Rates:
        """Return the rates of the arm `oracle`: its eyes never err, and its reachability check tells everything."""
        return replace(self, eyes=self.eyes.times(0.0), feedback=0.0, foreseen=1.0)
