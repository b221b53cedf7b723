"""Options that every step with a language model has: a step's Parameters inherit them. Cheap to import."""

from __future__ import annotations

import re
from typing import Literal

from pydantic import Field, field_validator
from pydantic_core import PydanticCustomError
from scenewright.stages.kit.services.address import check_address
from scenewright.stages.kit.stage import NOT_SHOWN, Parameters

ADDRESS_FORM = "http://HOST:PORT/v1"


class LanguageParameters(Parameters):
    """Who is asked, and how much. A key is never an option: the name of the variable that holds it is."""

    language: Literal["scripted", "recorded", "openai"] = Field(
        "scripted",
        description="Who answers in place of a language model or as one: `scripted`: a stand-in of ours, no model; "
        "`recorded`: a transcript; `openai`: any server with OpenAI's chat completions (docs/INTERPRET.md)",
    )
    model: str = Field("", description="Model that is asked, as the server calls it; recorded: empty takes the one")
    base_url: str = Field("http://127.0.0.1:8080/v1", description="Base URL of the server, mostly ending with /v1")
    key_variable: str = Field(
        "", description="NAME of the environment variable that holds the server's key (not the key); empty: no key"
    )
    temperature: float = Field(0.0, ge=0, le=2, description="Temperature of the replies; part of what is recorded")
    maximum_tokens: int = Field(4096, ge=16, le=1_000_000, description="Longest reply [tokens]")
    call_budget: int = Field(1000, ge=1, description="Times the model may be asked in one run, re-prompts included")
    token_budget: int = Field(10_000_000, ge=1, description="Tokens of prompts and replies in one run")
    request_timeout: float = Field(120.0, gt=0, le=3600, description="Timeout of a request [s]")
    retries: int = Field(3, ge=0, le=100, description="Retries after a transient fault")
    retry_wait: float = Field(
        1.0,
        ge=0,
        le=60,
        description="Wait before the first retry, doubled each time, longer where the server says so [s]",
    )

    @field_validator("key_variable")
    @classmethod
    def _is_a_name(cls, name: str) -> str:
        if name and not re.fullmatch(r"[A-Z_][A-Z0-9_]{0,99}", name):
            raise PydanticCustomError(
                NOT_SHOWN,
                "not the name of an environment variable (capitals, digits, _); a key itself is not an option",
            )
        return name

    @field_validator("base_url")
    @classmethod
    def _is_an_address(cls, address: str) -> str:
        try:
            return check_address(address, form=ADDRESS_FORM)
        except ValueError as error:
            raise PydanticCustomError(NOT_SHOWN, "{reason}", {"reason": str(error)}) from None
