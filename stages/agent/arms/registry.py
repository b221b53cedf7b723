"""The arms by name: which calls, which brain, which eyes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

from scenewright.stages.agent.arms.ours import Mechanisms, OwnSkills
from scenewright.stages.agent.arms.skills import CommonSkills
from scenewright.stages.agent.arms.thesis import ThesisSkills
from scenewright.stages.agent.body import Body
from scenewright.stages.agent.brains.beliefs import Style

ALL = Mechanisms()


@dataclass(frozen=True)
class Arm:
    """One way to do it."""

    skills: Callable[[Body], CommonSkills]
    style: Style = Style()
    one_program: bool = False
    true_eyes: bool = False
    """The eyes never err: `oracle` alone."""


def _ours(mechanisms: Mechanisms, *, true_eyes: bool = False) -> Arm:
    sides = mechanisms.other_sides
    style = Style(skilled=True, rounds=3 if sides else 1, thorough=2 if sides else 1)
    return Arm(lambda body: OwnSkills(body, mechanisms), style, true_eyes=true_eyes)


ARMS: dict[str, Arm] = {
    "open_loop": Arm(ThesisSkills, one_program=True),
    "bool_feedback": Arm(ThesisSkills),
    "thesis": Arm(ThesisSkills, Style(pictures=True)),
    "ours": _ours(ALL),
    "oracle": _ours(ALL, true_eyes=True),
    **{
        f"ours_without_{mechanism.name}": _ours(replace(ALL, **{mechanism.name: False}))
        for mechanism in fields(Mechanisms)
    },
}
