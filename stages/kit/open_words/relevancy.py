"""How well features fit a text: the relevancy of LERF (Kerr et al. 2023, section 3.5)."""

from __future__ import annotations

import numpy as np

from stages.kit.open_words.encoder import Encoder

CANONICAL = ("object", "things", "stuff", "texture")
"""Phrases that fit anything: a text is relevant where it fits better than each of these."""
TEMPERATURE = 10.0


def query_rows(encoder: Encoder, text: str) -> np.ndarray:
    """Return (1 + 4, width): the text, then the canonical phrases."""
    return encoder.texts((text, *CANONICAL))


def relevancy(features: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return (...,) in 0..1 of features (..., width): the least share exp(10 f.t) / (exp(10 f.t) + exp(10 f.c)) that the
    text t = rows[0] has against a canonical phrase c in rows[1:]."""
    fits = features @ rows.T
    apart = fits[..., 0] - fits[..., 1:].max(axis=-1)
    return 1.0 / (1.0 + np.exp(-TEMPERATURE * apart))
