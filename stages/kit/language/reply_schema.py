"""The JSON schema that a reply has to follow, from a pydantic model or as it stands, and how a reply is checked."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from jsonschema import Draft202012Validator
from jsonschema.exceptions import SchemaError
from pydantic import BaseModel, ValidationError
from referencing import Registry

T = TypeVar("T")
M = TypeVar("M", bound=BaseModel)

LONGEST_REASON = 400
"""Characters of what a reply got wrong, as it is said to the model and to people."""
MOST_REASONS = 5
"""Most reasons that the model is told at once."""


class DoesNotFollow(Exception):
    """A value that does not follow the schema; the message says where and why, in one line."""


@dataclass(frozen=True)
class ReplySchema(Generic[T]):
    """What a reply has to look like: `document` is the JSON schema that is sent, `read` checks and converts.

    `strict`: the document is in the narrower form that constrained decoding asks for (every property required, no
    others allowed).
    """

    name: str
    document: dict[str, Any]
    read: Callable[[Any], T]
    """Value -> typed reply; raises DoesNotFollow."""
    strict: bool


def schema_of(model: type[M]) -> ReplySchema[M]:
    """Return the schema of a pydantic model. The document asks for every field; a reply may leave out those with a
    default. Numbers in quotes are refused (strict mode): a model that writes them is told."""

    def read(value: Any) -> M:
        try:
            return model.model_validate_json(json.dumps(value), strict=True)
        except ValidationError as error:
            reasons = [f"{_place(e['loc'])}: {e['msg']}" for e in error.errors(include_url=False)]
            raise DoesNotFollow(_join_reasons(reasons)) from None

    return ReplySchema(model.__name__, _all_required(model.model_json_schema()), read, strict=True)


def schema_from(name: str, document: dict[str, Any]) -> ReplySchema[Any]:
    """Return a schema given as JSON schema (draft 2020-12). References to other documents are not followed.

    Raises ValueError when the document is no schema.
    """
    try:
        Draft202012Validator.check_schema(document)
    except SchemaError as error:
        raise ValueError(f"{name} is not a JSON schema: {error.message}") from None
    validator = Draft202012Validator(document, registry=Registry())

    def read(value: Any) -> Any:
        errors = sorted(validator.iter_errors(value), key=lambda e: list(map(str, e.absolute_path)))
        if errors:
            raise DoesNotFollow(_join_reasons([f"{_place(tuple(e.absolute_path))}: {e.message}" for e in errors]))
        return value

    return ReplySchema(name, document, read, strict=False)


def _all_required(document: Any) -> Any:
    """Return a schema whose objects require all of their properties and say no defaults."""
    if isinstance(document, list):
        return [_all_required(item) for item in document]
    if not isinstance(document, dict):
        return document
    completed = {key: _all_required(value) for key, value in document.items() if key != "default"}
    if isinstance(completed.get("properties"), dict):
        # A property may itself be called `default`, so that this level is copied from the original names.
        completed["properties"] = {name: _all_required(value) for name, value in document["properties"].items()}
        completed["required"] = list(completed["properties"])
        completed.setdefault("additionalProperties", False)
    return completed


def _place(path: tuple[Any, ...]) -> str:
    return ".".join(str(part) for part in path) or "the object"


def _join_reasons(reasons: list[str]) -> str:
    and_more = f" (and {len(reasons) - MOST_REASONS} more)" if len(reasons) > MOST_REASONS else ""
    text = " ".join("; ".join(reasons[:MOST_REASONS]).split())
    return (text if len(text) <= LONGEST_REASON else text[: LONGEST_REASON - 3] + "...") + and_more
