"""The scripted stand-ins for a language model in box packing: no model, a mediocre proposer that reads only the prompt.

Its habits were set once, from how chapter 4 describes the model's behaviour, and not fitted to any table: it looks at
a few places per box and takes the roomiest, seldom turns a box, on a collision mostly moves the box that failed and
sometimes the one that was named, on `no inverse kinematics` comes nearer to the robot. As at temperature 0, the reply
is a function of the prompt (and of a seed).
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from scenewright.stages.kit.language.backend import Request
from scenewright.stages.kit.language.chat import Chat, ChatSettings
from scenewright.stages.kit.language.scripted import ScriptedBackend
from scenewright.stages.pack.language_prompt import Variant
from scenewright.stages.pack.language_reading import Place, Seen, SeenPlan, read_prompt

PLACES_LOOKED_AT = 3
"""Draws of a placement of which the roomiest is taken; by eye."""
TURNED = 0.2
"""Share of boxes that are put down turned by a quarter."""
OFFENDER_MOVED = 0.3
"""Share of collisions after which the box that is named is moved too (backtrack)."""
MOST_SHUFFLES = 20
"""Orders that are thought of before a refused one is said again."""
QUARTER = 1.57
"""The quarter turn as a model writes it [rad]."""


def scripted_backend(variant: Variant, seed: int) -> ScriptedBackend:
    """Return the stand-in: `scripted:pack_backtrack`, `scripted:pack_scratch` or `scripted:pack_symbolic`."""
    return ScriptedBackend(f"pack_{variant}", lambda request: scripted_reply(request, variant, seed))


def scripted_chat(variant: Variant, seed: int) -> Chat:
    """Return a chat with the stand-in, within the default budget."""
    backend = scripted_backend(variant, seed)
    return Chat(backend, ChatSettings(model=backend.label))


def scripted_reply(request: Request, variant: Variant, seed: int) -> str:
    """Return the stand-in's reply to a prompt."""
    text = "\n".join(message.text for message in request.messages if message.role == "user")
    digest = hashlib.sha256(text.encode()).digest()
    random = np.random.default_rng([seed, *digest[:16]])
    prompt_read = read_prompt(text)
    last = prompt_read.plans[-1] if prompt_read.plans else None
    return json.dumps({"reasoning": _reasoning(last)} | _ANSWERS[variant](prompt_read, last, random))


def _backtrack(seen: Seen, last: SeenPlan | None, random: np.random.Generator) -> dict[str, Any]:
    planner = _Planner(seen, random)
    return {"plan": _calls(planner.mended(last) if last and last.places else planner.fresh())}


def _scratch(seen: Seen, last: SeenPlan | None, random: np.random.Generator) -> dict[str, Any]:
    return {"plan": _calls(_Planner(seen, random).fresh())}


def _symbolic(seen: Seen, last: SeenPlan | None, random: np.random.Generator) -> dict[str, Any]:
    return {"order": _order(seen, random)}


_ANSWERS: dict[Variant, Callable[[Seen, SeenPlan | None, np.random.Generator], dict[str, Any]]] = {
    "backtrack": _backtrack,
    "scratch": _scratch,
    "symbolic": _symbolic,
}


class _Planner:
    """Chooses places by what was seen; every choice is a draw of `random`."""

    def __init__(self, seen: Seen, random: np.random.Generator) -> None:
        self._seen, self._random = seen, random
        failed = [plan.failed for plan in seen.plans]
        radii = [math.hypot(*step.place[:2]) for step in failed if step and step.place and step.unreachable]
        self._reach = min(radii, default=math.inf)
        """Nearest place that the arm did not get to, as far as reasons were given [m from the robot]."""

    def fresh(self) -> dict[str, Place]:
        """Return new places for all boxes, in an order that puts a box that could not be picked last."""
        unpicked = {plan.failed.box for plan in self._seen.plans if plan.failed and plan.failed.place is None}
        places: dict[str, Place] = {}
        for box in sorted(self._seen.boxes, key=lambda name: name in unpicked):
            places[box] = self._place(box, places)
        return places

    def mended(self, last: SeenPlan) -> dict[str, Place]:
        """Return the last plan with other parameters for what failed, and at times for the cause that was named."""
        places = {box: place for box, place in last.places.items() if box in self._seen.boxes}
        for box in self._seen.boxes:
            if box not in places:
                places[box] = self._place(box, places)
        failed = last.failed
        if failed is None:
            for box in last.outside:
                if box in places:
                    places[box] = self._place(box, _without(places, box))
        elif failed.box not in places:
            return self.fresh()  # an invented name, or an order that cannot be
        elif failed.place is None:
            places[failed.box] = places.pop(failed.box)  # it is picked after all the others
        else:
            offender = failed.offender
            if offender in places and self._random.random() < OFFENDER_MOVED:
                places[offender] = self._place(offender, _without(places, offender, failed.box))
            before = _before(places, failed.box)
            places[failed.box] = self._place(failed.box, before)
        return places

    def _place(self, box: str, others: dict[str, Place]) -> Place:
        """Return the roomiest of a few draws within basket and reach."""
        draws = [self._draw(box) for _ in range(PLACES_LOOKED_AT)]
        return max(draws, key=lambda place: self._room(box, place, others))

    def _draw(self, box: str) -> Place:
        theta = QUARTER if self._random.random() < TURNED else 0.0
        width, length = self._extents(box, theta)
        low_x, high_x, low_y, high_y = self._seen.basket
        x = self._random.uniform(low_x + width / 2, max(low_x + width / 2, min(high_x - width / 2, self._reach)))
        y = self._random.uniform(low_y + length / 2, max(low_y + length / 2, high_y - length / 2))
        return (round(float(x), 2), round(float(y), 2), theta)

    def _room(self, box: str, place: Place, others: dict[str, Place]) -> float:
        """Return the least gap to what is there along the axis that parts them [m]; negative: overlap, or out of reach
        as far as that is known."""
        width, length = self._extents(box, place[2])
        gaps = [self._reach - math.hypot(place[0], place[1])]
        for name, placed in others.items():
            other_width, other_length = self._extents(name, placed[2])
            gap_x = abs(place[0] - placed[0]) - (width + other_width) / 2
            gaps.append(max(gap_x, abs(place[1] - placed[1]) - (length + other_length) / 2))
        for low_x, high_x, low_y, high_y in self._seen.obstacles.values():
            gap_x = max(low_x - place[0], place[0] - high_x) - width / 2
            gaps.append(max(gap_x, max(low_y - place[1], place[1] - high_y) - length / 2))
        return min(gaps)

    def _extents(self, box: str, theta: float) -> tuple[float, float]:
        width, length = self._seen.boxes.get(box, (0.0, 0.0))
        return (length, width) if abs(math.sin(theta)) > 0.7 else (width, length)


def _order(seen: Seen, random: np.random.Generator) -> list[str]:
    """Return large boxes first; after a failure the box that failed before the others; no order that was refused."""
    order = sorted(seen.boxes, key=lambda name: -seen.boxes[name][0] * seen.boxes[name][1])
    failed = seen.plans[-1].failed if seen.plans else None
    if failed is not None and failed.box in order:
        order.insert(0, order.pop(order.index(failed.box)))
    for _ in range(MOST_SHUFFLES):
        if tuple(order) not in seen.refused:
            break
        order = [order[k] for k in random.permutation(len(order))]
    return order


def _calls(places: dict[str, Place]) -> list[dict[str, Any]]:
    calls: list[dict[str, Any]] = []
    for box, (x, y, theta) in places.items():
        calls.append({"action": "pick", "objects": [box], "parameters": {}})
        calls.append({"action": "place", "objects": [box], "parameters": {"x": x, "y": y, "theta": theta}})
    return calls


def _reasoning(last: SeenPlan | None) -> str:
    if last is None:
        return "This is the first plan."
    if last.failed is None:
        return f"Not in the basket: {', '.join(last.outside) or 'nothing'}."
    return f"{last.failed.box} failed: {last.failed.reason or 'no reason was given'}."


def _without(places: dict[str, Place], *names: str) -> dict[str, Place]:
    return {name: place for name, place in places.items() if name not in names}


def _before(places: dict[str, Place], box: str) -> dict[str, Place]:
    """Return the places of the boxes that are put down before this one."""
    names: Iterable[str] = list(places)[: list(places).index(box)]
    return {name: places[name] for name in names}
