"""What somebody says is in a place, and what is not: queries.toml of `splat evaluate`."""

from __future__ import annotations

import json
from pathlib import Path

from pydantic import Field, ValidationError, field_validator
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput, ScenewrightError, first_problem
from scenewright.schemas.outside import LARGEST_SETTINGS, file_toml
from scenewright.schemas.scene_parts import Box
from scenewright.stages.kit.open_words.encoder import checked_text

HINT = "docs/SPLATS.md shows a queries.toml"


class There(Model):
    """A text, and every thing that it is true of."""

    text: str
    boxes: tuple[Box, ...] = Field(min_length=1)
    """In the frame of the language map [m]."""

    @field_validator("text")
    @classmethod
    def _asks(cls, text: str) -> str:
        return _check_text(text)


class Asked(Model):
    """queries.toml: what a place is asked for."""

    there: tuple[There, ...] = ()
    absent: tuple[str, ...] = ()
    """Texts that nothing there answers to."""

    @field_validator("absent")
    @classmethod
    def _ask(cls, texts: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(_check_text(text) for text in texts)


def _check_text(text: str) -> str:
    """Return a text that can be asked for. Raises ValueError."""
    try:
        return checked_text(text)
    except ScenewrightError as error:
        raise ValueError(str(error)) from None


def read_asked(path: Path) -> Asked:
    """Read and check a queries.toml. Raises BadInput in one line that names the field that is wrong, or where nothing
    is asked."""
    values = file_toml(path, LARGEST_SETTINGS, hint=HINT)
    try:
        questions = Asked.model_validate_json(json.dumps(values, default=str))
    except ValidationError as error:
        raise BadInput(f"{path}: {first_problem(error)}", hint=HINT) from None
    if not questions.there and not questions.absent:
        raise BadInput(f"{path}: nothing is asked", hint=HINT)
    return questions
