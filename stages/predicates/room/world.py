"""A room of the chain whose boxes and joints actions move. What fails is what boxes say: the hand is full or the thing
too wide, something stands on it, a door is shut, there is no room. Motions of an arm and physics are `plan`'s."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenewright.stages.kit.predicates.room import Body, RoomState
from scenewright.stages.kit.tasks.strips import Atom

OPEN, SHUT = 1.0, 0.0
"""Openness of a door that is open, and of one that is shut."""
HALF_OPEN = 0.5
"""Openness from which on a door counts as open."""
DRAWS, CLEARANCE = 60, 0.01
"""Places that are tried on a top; distance kept from what stands there [m]."""
CARRIED = (0.3, 0.0, 1.1)
"""Place of what is held, before the robot [m]; by eye."""


class RoomWorld:
    """A room that actions change. Seeded."""

    def __init__(self, state: RoomState, seed: int) -> None:
        self._state = state
        self._random = np.random.default_rng([seed, 17])

    def state(self) -> RoomState:
        """What is perceived now."""
        return self._state

    def do(self, action: Atom) -> str:
        """Do an action. Returns why it failed, or nothing."""
        return str(getattr(self, f"_{action[0]}")(*action[1:]))

    def _pick(self, name: str) -> str:
        state = self._state
        body = state.bodies[name]
        inside = state.contained.get(name)
        if state.held:
            return "the hand is full"
        if body.width >= state.hand_opening:
            return f"{name} is wider than the hand opens"
        if name in state.supported.values():
            return f"something stands on {name}"
        if inside is not None and state.bodies[inside].doors and state.bodies[inside].openness < HALF_OPEN:
            return f"{inside} is shut"
        if body.along(2, -1.0) > state.reach[1]:
            return f"{name} is too high"
        self._state = replace(
            state,
            bodies={**state.bodies, name: replace(body, middle=CARRIED)},
            supported={key: value for key, value in state.supported.items() if key != name},
            contained={key: value for key, value in state.contained.items() if key != name},
            held=name,
        )
        return ""

    def _place(self, name: str, under: str) -> str:
        state = self._state
        carrier = state.bodies[under]
        if state.held != name:
            return f"{name} is not in the hand"
        if carrier.surface <= 0.0 or carrier.along(2, -1.0) > state.reach[1]:
            return f"nothing can be put on {under}"
        middle = self._free_place(state.bodies[name], under)
        if middle is None:
            return f"there is no room on {under}"
        put = replace(state.bodies[name], middle=middle)
        self._state = replace(
            state, bodies={**state.bodies, name: put}, supported={**state.supported, name: under}, held=""
        )
        return ""

    def _free_place(self, body: Body, under: str) -> tuple[float, float, float] | None:
        """Return the middle of a free place on the top of a carrier's box, None when none was found. On what is small
        itself a thing stands in the middle."""
        state = self._state
        carrier = state.bodies[under]
        height = carrier.along(2, 1.0) + body.edges[2] / 2
        others = [state.bodies[name] for name, below in state.supported.items() if below == under]
        slack = [max(0.0, (carrier.edges[axis] - body.edges[axis]) / 2) for axis in (0, 1)]
        for _ in range(DRAWS):
            x, y = (carrier.middle[axis] + float(self._random.uniform(-1, 1)) * slack[axis] for axis in (0, 1))
            overlaps = (
                abs(x - neighbour.middle[0]) < (body.edges[0] + neighbour.edges[0]) / 2 + CLEARANCE
                and abs(y - neighbour.middle[1]) < (body.edges[1] + neighbour.edges[1]) / 2 + CLEARANCE
                for neighbour in others
            )
            if not any(overlaps):
                return x, y, height
        return None

    def _put_in(self, name: str, container: str) -> str:
        state = self._state
        around = state.bodies[container]
        body = state.bodies[name]
        if state.held != name:
            return f"{name} is not in the hand"
        if not around.doors or around.openness < HALF_OPEN:
            return f"{container} is not open"
        if any(body.edges[axis] > around.edges[axis] for axis in range(3)):
            return f"{name} does not fit into {container}"
        put = replace(body, middle=around.middle)
        self._state = replace(
            state, bodies={**state.bodies, name: put}, contained={**state.contained, name: container}, held=""
        )
        return ""

    def _open(self, name: str) -> str:
        return self._turn_door(name, OPEN)

    def _close(self, name: str) -> str:
        return self._turn_door(name, SHUT)

    def _turn_door(self, name: str, openness: float) -> str:
        body = self._state.bodies[name]
        if self._state.held:
            return "the hand is full"
        if not body.doors:
            return f"{name} has nothing that opens"
        self._state = self._state.moved(name, replace(body, openness=openness))
        return ""
