"""Options of every step that encodes pictures or words: a step's Parameters inherit them. Cheap to import."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, field_validator
from pydantic_core import PydanticCustomError
from scenewright.stages.kit.labels import LABEL_TABLES
from scenewright.stages.kit.services.address import check_address
from scenewright.stages.kit.stage import NOT_SHOWN, External, Extra, Optionally, Parameters

ADDRESS_FORM = "http://HOST:PORT"
WEIGHTS = Optionally(
    External("CLIP or SigLIP folder for --encoder huggingface, or another .safetensors for embedded", weights=True)
)
EXTRAS = (
    Extra("transformers", "transformers", "--encoder huggingface: pip install transformers (without torchvision)"),
)


class EncoderParameters(Parameters):
    """Who encodes pictures and words."""

    encoder: Literal["embedded", "huggingface", "service"] = Field(
        "embedded",
        description="`embedded`: the small encoder that comes with the project; `huggingface`: a CLIP or SigLIP of "
        "transformers (--weights); `service`: whatever answers at --encoder-address (docs/SPLATS.md)",
    )
    encoder_address: str = Field("http://127.0.0.1:8090", description="Where --encoder service is asked")

    @field_validator("encoder_address")
    @classmethod
    def _is_an_address(cls, address: str) -> str:
        try:
            return check_address(address, form=ADDRESS_FORM)
        except ValueError as error:
            raise PydanticCustomError(NOT_SHOWN, "{reason}", {"reason": str(error)}) from None


READING_FILES = (
    "words/nouns.txt.gz",
    "words/anchors.toml",
    "words/meanings.toml",
    "words/attributes.toml",
    "words/wants.toml",
    *LABEL_TABLES,
)
"""Files of data/ that words are read with (`reading/`)."""


def encoder_files(parameters: EncoderParameters) -> tuple[str, ...]:
    """Return the files of data/ that encoding reads."""
    return ("words/two_towers.safetensors",) if parameters.encoder == "embedded" else ()
