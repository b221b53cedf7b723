"""How well features fit a text: the relevancy of LERF (Kerr et al. 2023, section 3.5)."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.open_words.encoder import Encoder

CANONICAL = ("object", "things", "stuff", "texture")
"""Phrases that fit anything: a text is relevant where it fits better than each of these."""
TEMPERATURE = 10.0
"""Factor of the margins in the relevancy (LERF, Kerr et al. 2023)."""


def query_rows(encoder: Encoder, text: str) -> np.ndarray:
    """Return (1 + 4, width): the text, then the canonical phrases."""
    return encoder.texts((text, *CANONICAL))


def margins(features: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return (...,): how much nearer features (..., width) are to the text rows[0] than to the nearest canonical
    phrase, one of rows[1:]."""
    flat = features.reshape(-1, features.shape[-1]) @ rows.T
    return (flat[:, 0] - flat[:, 1:].max(axis=1)).reshape(features.shape[:-1])


def relevancy(margin: np.ndarray) -> np.ndarray:
    """Return (...,) in 0..1 of margins: the least share exp(10 f.t) / (exp(10 f.t) + exp(10 f.c)) that the text t has
    against a canonical phrase c."""
    return 1.0 / (1.0 + np.exp(-TEMPERATURE * margin))
