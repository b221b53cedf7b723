"""What an arm of the trials is composed of: one mechanism for every decision in which the arms differ.

The state machine (insertion.py, extraction.py, handover.py) executes; what it asks is answered by these objects. The
thesis's are in thesis/, ours in ours/; policies.py composes the arms.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from scenewright.stages.suture.motion.constants import OpenConstants
from scenewright.stages.suture.trials.belief import Belief
from scenewright.stages.suture.trials.bench import Bench
from scenewright.stages.suture.trials.perception import Seen


class Trust(Protocol):
    """Which estimates are believed."""

    def look(self, bench: Bench, place: str, where: np.ndarray) -> Seen | None:
        """Return one estimate of a needle that must pass one of the points `where` (K, 3) [m]; None for none that is
        believed."""
        ...

    def seems_out(self, bench: Bench, before: Seen, out: bool) -> bool:
        """Return whether the robot takes the needle, seen `before` in tissue, for extracted; `out`: whether it is."""
        ...


class Coordination(Protocol):
    """When a driver that has nothing to hold moves."""

    def withdraw(self, bench: Bench, arm: str, pose: np.ndarray) -> None:
        """Take an empty driver away to a pose (4, 4)."""
        ...

    def wait_at(self, bench: Bench, arm: str, pose: np.ndarray) -> None:
        """Send an empty driver to the pose (4, 4) where it will be wanted, or leave it where it is."""
        ...

    def near_entry(self, bench: Bench, rotation: np.ndarray, place: np.ndarray) -> None:
        """Lead the right driver, oriented by `rotation` (3, 3), towards its place (3,) [m] for insertion."""
        ...

    def after_sweep(self, bench: Bench) -> None:
        """Take the left driver from the end of its sweep to where it does not hide the needle."""
        ...

    def stand_back(self, bench: Bench, attempt: int) -> None:
        """Take the left driver to where it does not hide the needle, before extraction's try `attempt` (0 first)."""
        ...


class PoseCorrection(Protocol):
    """How the needle in the right driver is made ready for insertion."""

    def believed(self, bench: Bench, trust: Trust) -> Belief:
        """Return what the robot believes of it. Raises Failed (I) where the needle can't be known."""
        ...


class Sweep(Protocol):
    """What becomes of thread that lies over the wound before extraction."""

    def sweep(self, bench: Bench, coordination: Coordination) -> None:
        """Clear it away, or not."""
        ...


class Expectation(Protocol):
    """What is believed of a needle in tissue that can't be known by looking."""

    def expected(self, bench: Bench, attempt: int) -> Seen | None:
        """Return where it is taken to lie at try `attempt` (0 first); None for nowhere."""
        ...


class Grasp(Protocol):
    """Where jaws close on a seen needle."""

    def to_extract(self, bench: Bench, seen: Seen) -> np.ndarray:
        """Return the left driver's poses (K, 4, 4) on its way to a needle in tissue."""
        ...

    def turn_out(self, seen: Seen) -> float:
        """Return by what angle [rad] a grasped needle is turned out of the tissue."""
        ...

    def to_take(self, seen: Seen, holder: np.ndarray) -> np.ndarray:
        """Return the point (3,) [m] that the right jaws close on while a driver at (3,) holds the needle."""
        ...


class Cinch(Protocol):
    """How far thread is pulled through a stitch."""

    panel: str
    """What the recorded moment after it is called."""

    def pull(self, bench: Bench, constants: OpenConstants) -> float:
        """Pull, and return how far [m] from the exit the needle is then."""
        ...


class SlackWatch(Protocol):
    """What is done about a stitch that stays loose."""

    def tighten(self, bench: Bench) -> None:
        """Pull on, or not."""
        ...


class HandoverThread(Protocol):
    """What is done about thread that is too short for what comes after handover."""

    def lengthen(self, bench: Bench) -> None:
        """Draw more through the stitches with the right driver, or not."""
        ...


class HandoverTest(Protocol):
    """How the robot knows that the needle was handed over."""

    def look(self, bench: Bench, trust: Trust) -> Seen | None:
        """Look at the presented needle; None when it can't be known."""
        ...

    def passed(self, before: Seen, after: Seen, holder: np.ndarray, constants: OpenConstants) -> bool:
        """Return whether the right driver is taken to hold it too, by looks before and after it closed its jaws; the
        left driver at `holder` (3,) [m] held it before."""
        ...


@dataclass(frozen=True)
class Policy:
    """One arm of the experiment."""

    name: str
    perception: str
    """The error model by which it sees: data/stitch/perception_<name>.toml."""
    trust: Trust
    coordination: Coordination
    pose_correction: PoseCorrection
    sweep: Sweep
    expectation: Expectation
    grasp: Grasp
    cinch: Cinch
    slack_watch: SlackWatch
    handover_thread: HandoverThread
    handover_test: HandoverTest
    interventions: int = 0
    constants: OpenConstants = field(default_factory=OpenConstants)
