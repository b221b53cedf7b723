"""An encoder of colours alone: what it knows is known, so that what is made of it can be checked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.stages.kit.open_words.encoder import unit

COLORS = {"red": (1.0, 0.1, 0.1), "green": (0.1, 1.0, 0.1), "blue": (0.1, 0.1, 1.0)}


class ColorEncoder:
    """A picture is its mean colour; a colour's word is that colour; every other word is grey."""

    label, width, side = "colours", 3, 8

    def pictures(self, crops: np.ndarray) -> np.ndarray:
        middle = crops[:, 2:6, 2:6].reshape(len(crops), -1, 3).mean(axis=1)
        return unit(middle / 255.0 + 1e-3)

    def texts(self, texts: Sequence[str]) -> np.ndarray:
        return unit(np.array([COLORS.get(text, (1.0, 1.0, 1.0)) for text in texts], np.float32))

    def unread(self, text: str) -> tuple[str, ...]:
        return tuple(word for word in text.split() if word not in COLORS)
