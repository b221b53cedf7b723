"""Correlation of every pixel with every pixel of its row in the other eye, at several widths, looked up where the
disparity points."""

from __future__ import annotations

import math

import torch
from torch.nn import functional


class RowCorrelation:
    """The pyramid of correlations of two feature maps (N, C, h, w)."""

    def __init__(self, left: torch.Tensor, right: torch.Tensor, levels: int, radius: int) -> None:
        count, channels, height, width = left.shape
        rows = torch.matmul(left.permute(0, 2, 3, 1), right.permute(0, 2, 1, 3)) / math.sqrt(channels)
        volume = rows.reshape(count * height * width, 1, right.shape[3])
        self.size, self.radius = (count, height, width), radius
        self.pyramid = [volume]
        for _ in range(levels - 1):
            volume = functional.avg_pool1d(volume, 2) if volume.shape[2] > 1 else volume
            self.pyramid.append(volume)

    def at(self, column: torch.Tensor) -> torch.Tensor:
        """Return correlations (N, levels * (2 radius + 1), h, w) around columns (N, h, w) of the right map [px],
        finest level first, between pixels by linear interpolation; outside of the row they are zero."""
        around = torch.arange(-self.radius, self.radius + 1, dtype=column.dtype, device=column.device)
        levels = []
        for level, volume in enumerate(self.pyramid):
            columns = column.reshape(-1, 1) / 2**level + around
            levels.append(sampled(volume[:, 0], columns))
        return torch.cat(levels, dim=1).reshape(*self.size, -1).permute(0, 3, 1, 2)


def sampled(rows: torch.Tensor, places: torch.Tensor) -> torch.Tensor:
    """Return values (N, K) of rows (N, W) at places (N, K) [px], linear between pixels, zero outside."""
    low = torch.floor(places)
    share = places - low
    padded = functional.pad(rows, (1, 1))
    last = padded.shape[1] - 1
    first = (low.long() + 1).clamp(0, last)
    second = (low.long() + 2).clamp(0, last)
    return (1 - share) * padded.gather(1, first) + share * padded.gather(1, second)
