"""The JSON schema of a plan in a checked plan language: one form per action, with its numbers and their ranges."""

from __future__ import annotations

from typing import Any

from scenewright.stages.kit.language.actions import MOST_CALLS, ActionLanguage, ActionType, PlanReply, check_calls
from scenewright.stages.kit.language.reply_schema import DoesNotFollow, ReplySchema, schema_of


def plan_schema(language: ActionLanguage, *, closed_names: bool = False) -> ReplySchema[PlanReply]:
    """Return the schema of `{"reasoning": ..., "plan": [calls]}`.

    A reply follows it when every call passes `check_calls`. `closed_names`: the names of the scene are part of the
    schema. Otherwise any name follows it, and an invented one is left to the step, which may count it as a mistake.
    """
    inner = schema_of(PlanReply)

    def read(value: Any) -> PlanReply:
        reply = inner.read(value)
        for finding in check_calls(reply.plan, language):
            if closed_names or finding.failure.kind != "unknown_object":
                raise DoesNotFollow(f"plan.{finding.index}: {finding.failure.message}")
        return reply

    forms = [_form(action, language, closed_names) for action in language.actions]
    properties = {
        "reasoning": {"type": "string"},
        "plan": {"type": "array", "maxItems": MOST_CALLS, "items": {"anyOf": forms}},
    }
    return ReplySchema("Plan", _object(properties), read, strict=True)


def _form(action: ActionType, language: ActionLanguage, closed_names: bool) -> dict[str, Any]:
    names: list[dict[str, Any]] = [{"type": "string"} for _ in action.objects]
    if closed_names:
        names = [{"type": "string", "enum": sorted(language.names[kind])} for kind in action.objects]
    count = len(names)
    objects: dict[str, Any] = {"type": "array", "minItems": count, "maxItems": count}
    if names:
        objects["items"] = names[0] if all(name == names[0] for name in names) else {"anyOf": names}
    numbers = {
        name: {"type": "number", "minimum": allowed.low, "maximum": allowed.high}
        for name, allowed in action.numbers.items()
    }
    return _object(
        {"action": {"type": "string", "enum": [action.name]}, "objects": objects, "parameters": _object(numbers)}
    )


def _object(properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": properties, "required": list(properties), "additionalProperties": False}
