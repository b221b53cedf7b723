"""Random numbers of a batch on a device."""

from __future__ import annotations

import numpy as np
import torch


class Draws:
    """Every use takes another row of a table that went to the device at once, drawn on the processor: another device
    draws the same."""

    def __init__(self, random: np.random.Generator, count: int, device: torch.device, rows: int = 64) -> None:
        self._rows = iter(torch.from_numpy(random.random((rows, count), dtype=np.float32)).to(device))

    def uniform(self, low: float = 0.0, high: float = 1.0) -> torch.Tensor:
        """Return (B,) numbers between `low` and `high`."""
        return low + (high - low) * next(self._rows)

    def chance(self, share: float) -> torch.Tensor:
        """Return (B,) bool, true in this share."""
        return next(self._rows) < share

    def normal(self, deviation: float) -> torch.Tensor:
        """Return (B,) numbers of a normal distribution about 0."""
        return deviation * 2**0.5 * torch.erfinv((2 * next(self._rows) - 1).clamp(-0.999999, 0.999999))
