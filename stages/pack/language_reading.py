"""What a scripted stand-in understands of a prompt: it reads the text of language_prompt.py and nothing else."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field

from scenewright.stages.pack.language_prompt import ATTEMPT, FAILS, FEASIBLE, NOT_IN_BASKET, NOT_TRIED, REFUSED_ORDER

NAME = r'("(?:[^"\\]|\\.)*")'
NUMBER = r"(-?\d+(?:\.\d+)?(?:e-?\d+)?)"
RECTANGLE = re.compile(rf"^(basket|obstacle) {NAME}: x from {NUMBER} to {NUMBER}, y from {NUMBER} to {NUMBER}$")
BOX = re.compile(rf"^box {NAME}: {NUMBER} along x and {NUMBER} along y at theta 0, .*, (not )?in the basket$")
STEP = re.compile(
    rf"^  \d+\. (?:pick\({NAME}\)|place\({NAME}, x={NUMBER}, y={NUMBER}, theta={NUMBER}\)): "
    rf"({FEASIBLE}|{NOT_TRIED}|{FAILS})(?:; (.*))?$"
)
QUOTED = re.compile(NAME)
COLLISION = re.compile(rf"^the goal configuration is in collision with {NAME}")
UNREACHABLE = "no inverse kinematics"

Place = tuple[float, float, float]
"""x [m], y [m], theta [rad]."""


@dataclass(frozen=True)
class SeenStep:
    """One action of an earlier plan."""

    box: str
    place: Place | None
    """None: a pick."""
    outcome: str
    reason: str
    """Empty when none was given."""

    @property
    def offender(self) -> str | None:
        """The name that a collision was with, or None."""
        match = COLLISION.match(self.reason)
        return _name(match[1]) if match else None

    @property
    def unreachable(self) -> bool:
        """Whether the reason is that the arm does not get there."""
        return UNREACHABLE in self.reason


@dataclass(frozen=True)
class SeenPlan:
    """An earlier plan, and which boxes were not in the basket after it."""

    steps: tuple[SeenStep, ...]
    outside: tuple[str, ...]

    @property
    def failed(self) -> SeenStep | None:
        """The step that failed, or None."""
        return next((step for step in self.steps if step.outcome == FAILS), None)

    @property
    def places(self) -> dict[str, Place]:
        """Where the plan puts each box, in its order."""
        return {step.box: step.place for step in self.steps if step.place is not None}


@dataclass(frozen=True)
class Seen:
    """All that the prompt says of the scene and of earlier plans."""

    basket: tuple[float, float, float, float]
    """Low x, high x, low y, high y [m]."""
    obstacles: dict[str, tuple[float, float, float, float]]
    boxes: dict[str, tuple[float, float]]
    """Extents along x and y at theta 0 [m], of those not yet in the basket."""
    plans: tuple[SeenPlan, ...] = field(default=())
    refused: tuple[tuple[str, ...], ...] = field(default=())
    """Orders without an arrangement."""


def read_prompt(text: str) -> Seen:
    """Return what the user message says. Raises ValueError when it names no basket."""
    basket: tuple[float, float, float, float] | None = None
    obstacles, boxes = {}, {}
    plans: list[SeenPlan] = []
    steps: list[SeenStep] = []
    outside: tuple[str, ...] = ()
    refused: list[tuple[str, ...]] = []
    inside_plan = False
    for line in [*text.split("\n"), f"{ATTEMPT} 0:"]:
        if rectangle := RECTANGLE.match(line):
            extent = (float(rectangle[3]), float(rectangle[4]), float(rectangle[5]), float(rectangle[6]))
            if rectangle[1] == "basket":
                basket = extent
            else:
                obstacles[_name(rectangle[2])] = extent
        elif box := BOX.match(line):
            if box[4]:
                boxes[_name(box[1])] = (float(box[2]), float(box[3]))
        elif line.startswith(f"{ATTEMPT} "):
            plans += [SeenPlan(tuple(steps), outside)] if inside_plan else []
            steps, outside, inside_plan = [], (), True
        elif step := STEP.match(line):
            steps.append(_step(step))
        elif line.startswith(f"  {NOT_IN_BASKET}"):
            outside = _names(line)
        elif line.startswith(REFUSED_ORDER):
            refused.append(_names(line.split("; why: ")[0]))
    if basket is None:
        raise ValueError("the prompt names no basket")
    return Seen(basket, obstacles, boxes, tuple(plans), tuple(refused))


def _step(match: re.Match[str]) -> SeenStep:
    target = None if match[1] else (float(match[3]), float(match[4]), float(match[5]))
    return SeenStep(_name(match[1] or match[2]), target, match[6], match[7] or "")


def _names(line: str) -> tuple[str, ...]:
    return tuple(_name(match[0]) for match in QUOTED.finditer(line))


def _name(literal: str) -> str:
    return str(json.loads(literal))
