"""What an encoder of pictures and words is, whoever trained it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from scenewright.schemas.errors import BadInput, UsageError

LONGEST_TEXT = 200
"""Longest query [characters]."""


class Encoder(Protocol):
    """Pictures and words as unit vectors of one width: a picture is near the words that fit it."""

    label: str
    """Which encoder, in words; what two encoders make never mixes."""
    width: int
    side: int
    """Pictures are asked for at this height and width [px]."""

    def pictures(self, crops: np.ndarray) -> np.ndarray:
        """Return (N, width) float32 unit vectors of crops (N, side, side, 3) uint8 RGB."""
        ...

    def texts(self, texts: Sequence[str]) -> np.ndarray:
        """Return (M, width) float32 unit vectors of texts."""
        ...

    def unread(self, text: str) -> tuple[str, ...]:
        """Return the words of a text that the encoder is known never to have read."""
        ...


def checked_text(text: str) -> str:
    """Return a query without white space around and doubled within it. Raises UsageError for one that is empty, too
    long, or not made of letters."""
    plain = " ".join(text.split())
    if not any(letter.isalnum() for letter in plain):
        raise UsageError("a query needs words", hint='give one: --text "red mug"')
    if len(plain) > LONGEST_TEXT:
        raise UsageError(f"a query of {len(plain)} characters", hint=f"at most {LONGEST_TEXT}: name one thing")
    return plain


def check_width(encoder: Encoder, width: int, label: str, where: str) -> None:
    """Raise BadInput unless features of this width and label are the encoder's."""
    if encoder.width != width or encoder.label != label:
        raise BadInput(
            f"{where}: its features are {width} wide, of {label!r:.80}; the encoder given is {encoder.width} wide, "
            f"{encoder.label!r:.80}",
            hint="ask with the encoder that it was made with, or make it again",
        )


def unit(rows: np.ndarray) -> np.ndarray:
    """Return rows (N, width) of length 1; rows of zeros stay."""
    rows = np.asarray(rows, np.float32)
    return rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), np.float32(1e-8))
