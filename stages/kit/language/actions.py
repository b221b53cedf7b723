"""A checked plan language: what a model may propose, and what is wrong with what it did propose.

A reply is a list of calls: an action's name, names of objects, named numbers. Each is compared with what the step
declares and with the names of the scene. What does not fit is a typed finding that can go back to the model; what fits
is data for a planner. Nothing is evaluated, looked up or executed by the text of a reply.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches

from pydantic import Field
from scenewright.schemas.base import Model
from scenewright.schemas.plan import Failure

LONGEST_NAME = 200
"""Characters of a name that are said: as many as a scene's names may have; a model's own may be of any length."""
MOST_CALLS = 200
"""Most actions of a plan in a reply; a bound, by eye."""


class ActionCall(Model):
    """One call as a reply holds it: any strings, any finite numbers."""

    action: str
    objects: tuple[str, ...] = ()
    parameters: dict[str, float] = {}


class PlanReply(Model):
    """A plan as a reply holds it."""

    reasoning: str = Field("", description="Why the last plan failed and what this one does about it")
    plan: tuple[ActionCall, ...] = Field(description="Every action from the initial state on", max_length=MOST_CALLS)


@dataclass(frozen=True)
class NumberRange:
    """A closed range; `unit` is written behind its numbers."""

    low: float
    high: float
    unit: str = ""


@dataclass(frozen=True)
class ActionType:
    """An action that may be called: for each argument the kind of object, and each number with its range."""

    name: str
    objects: tuple[str, ...]
    """Kinds, keys of `ActionLanguage.names`."""
    numbers: Mapping[str, NumberRange] = field(default_factory=dict)


@dataclass(frozen=True)
class ActionLanguage:
    """What may be said of one scene: actions, and for each kind of object the names that there are."""

    actions: tuple[ActionType, ...]
    names: Mapping[str, frozenset[str]]

    def action(self, name: str) -> ActionType | None:
        """Return the action of that name, compared exactly, or None."""
        return next((action for action in self.actions if action.name == name), None)


@dataclass(frozen=True)
class Finding:
    """What is wrong with call number `index` (0 first); `failure.kind` is `unknown_action`, `wrong_arguments`,
    `unknown_object`, `wrong_numbers` or `out_of_range`."""

    index: int
    failure: Failure


def check_calls(calls: Sequence[ActionCall], language: ActionLanguage) -> tuple[Finding, ...]:
    """Return what is wrong with each call, the first reason only; none: all may be handed to a planner."""
    findings = []
    for index, call in enumerate(calls):
        failure = check_call(call, language)
        if failure is not None:
            findings.append(Finding(index, failure))
    return tuple(findings)


def check_call(call: ActionCall, language: ActionLanguage) -> Failure | None:
    """Return what is wrong with a call, or None."""
    action = language.action(call.action)
    if action is None:
        names = ", ".join(item.name for item in language.actions)
        return _failure("unknown_action", call, f"there is no action {quoted(call.action)}; there are {names}")
    if len(call.objects) != len(action.objects):
        message = f"{action.name} takes {len(action.objects)} objects, not {len(call.objects)}"
        return _failure("wrong_arguments", call, message, {"wanted": len(action.objects), "given": len(call.objects)})
    for name, kind in zip(call.objects, action.objects, strict=True):
        known_names = language.names.get(kind, frozenset())
        if name not in known_names:
            return _failure(
                "unknown_object", call, f"there is no {kind} {quoted(name)}{_suggestion(name, known_names)}"
            )
    return _check_numbers(call, action)


def quoted(name: str) -> str:
    """Return a name as a JSON string on one line, cut when long: no name can end a line or leave its quotes."""
    cut = name if len(name) <= LONGEST_NAME else name[:LONGEST_NAME] + "..."
    return json.dumps(cut).replace("\x7f", "\\u007f")  # the one unprintable character that JSON leaves as it is


def _check_numbers(call: ActionCall, action: ActionType) -> Failure | None:
    missing = [name for name in action.numbers if name not in call.parameters]
    strange = [name for name in call.parameters if name not in action.numbers]
    if missing or strange:
        expected = ", ".join(action.numbers) or "no numbers"
        which = f"{missing[0]} is missing" if missing else f"{quoted(strange[0])} is none of them"
        return _failure("wrong_numbers", call, f"{action.name} takes {expected}; {which}")
    for name, allowed in action.numbers.items():
        value = call.parameters[name]
        if not allowed.low <= value <= allowed.high:
            unit = f" {allowed.unit}" if allowed.unit else ""
            message = f"{name} = {value:g} of {action.name} is not within [{allowed.low:g}, {allowed.high:g}]{unit}"
            return _failure("out_of_range", call, message, {"value": value, "low": allowed.low, "high": allowed.high})
    return None


def _suggestion(name: str, names: frozenset[str]) -> str:
    close = get_close_matches(name[:LONGEST_NAME], sorted(names), n=1)
    return f"; did you mean {quoted(close[0])}?" if close else f"; there are {len(names)} others" if names else ""


def _failure(kind: str, call: ActionCall, message: str, numbers: Mapping[str, float] | None = None) -> Failure:
    return Failure(
        kind=kind,
        message=message,
        action=call.action[:LONGEST_NAME],
        objects=tuple(name[:LONGEST_NAME] for name in call.objects),
        numbers={name: float(value) for name, value in (numbers or {}).items()},
    )
