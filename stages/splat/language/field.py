"""The language field: hash grids over the room and a small network give a vector at a place and a size.

Two grids of 12 levels, resolutions 16 to 128 and 128 to 512, 4 numbers a level, 96 in all and the size, into three
hidden layers of 256 (the thesis's code; Müller et al. 2022). Space beyond the middle of the room is contracted as in
mip-NeRF 360 (Barron et al. 2022). The table has 2^16 entries a level where the thesis has 2^19.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import nn

GRIDS = ((16, 128), (128, 512))
"""Coarsest and finest cells along each side of the two hash grids."""
LEVELS = 12
"""Levels of each grid."""
ENTRIES = 2**16
"""Entries of a level's table: 2^16, where the thesis has 2^19 (docs/SPLATS.md)."""
NUMBERS = 4
"""Numbers of an entry."""
HIDDEN, LAYERS = 256, 3
"""Width of the network's layers, and their number."""
PRIMES = (1, 2654435761, 805459861)
"""Factors of the spatial hash (Mueller et al. 2022)."""
CORNERS = np.array([[a, b, c] for a in (0, 1) for b in (0, 1) for c in (0, 1)])
"""The corners (8, 3) of a cell."""
INNER = (1.0, 99.0)
"""Percentiles of the Gaussians' centres between which space is not contracted."""
CHUNK = 32768
"""Places that are asked for at once: memory, not results, depends on it. By eye."""


class HashGrid(nn.Module):
    """Places (N, 3) in 0..1 -> (N, width), `numbers` for each of 2 x 12 levels."""

    resolutions: torch.Tensor
    corners: torch.Tensor

    def __init__(self, entries: int, numbers: int = NUMBERS) -> None:
        super().__init__()
        self.entries, self.numbers, self.width = entries, numbers, 2 * LEVELS * numbers
        sizes = [low * (high / low) ** (k / (LEVELS - 1)) for low, high in GRIDS for k in range(LEVELS)]
        self.register_buffer("resolutions", torch.tensor(np.floor(sizes), dtype=torch.float32), persistent=False)
        self.register_buffer("corners", torch.tensor(CORNERS, dtype=torch.int64), persistent=False)
        self.table = nn.Parameter(1e-4 * (2 * torch.rand(len(sizes) * entries, numbers) - 1))

    def forward(self, places: torch.Tensor) -> torch.Tensor:
        """Return what the corners around each place hold, trilinear, level by level."""
        levels = len(self.resolutions)
        scaled = places[:, None, :] * self.resolutions[None, :, None]  # (N, L, 3)
        low = scaled.floor()
        part = scaled - low
        corner = low.long()[:, :, None, :] + self.corners  # (N, L, 8, 3)
        hashed = corner[..., 0] * PRIMES[0] ^ corner[..., 1] * PRIMES[1] ^ corner[..., 2] * PRIMES[2]
        row = (hashed & (self.entries - 1)) + torch.arange(levels)[None, :, None] * self.entries
        weight = torch.where(self.corners.bool(), part[:, :, None, :], 1 - part[:, :, None, :]).prod(-1)
        embedded = nn.functional.embedding_bag(
            row.reshape(-1, 8), self.table, per_sample_weights=weight.reshape(-1, 8), mode="sum"
        )
        return embedded.reshape(len(places), levels * self.numbers)


class Space:
    """Where the grids lie: about these centres (N, 3) [m], space beyond most of them contracted."""

    def __init__(self, centers: np.ndarray) -> None:
        low, high = np.percentile(centers, INNER[0], axis=0), np.percentile(centers, INNER[1], axis=0)
        self.middle = torch.tensor((low + high) / 2, dtype=torch.float32)
        self.reach = torch.tensor(np.maximum((high - low) / 2, 0.1), dtype=torch.float32)

    def __call__(self, places: torch.Tensor) -> torch.Tensor:
        """Return places (N, 3) [m] in 0..1."""
        inner = (places - self.middle) / self.reach
        norm = inner.abs().amax(dim=1, keepdim=True).clamp(min=1e-6)
        outer = torch.where(norm > 1, (2 - 1 / norm) * inner / norm, inner)
        return (outer + 2) / 4


class LanguageField(nn.Module):
    """Places [m, world] and sizes [m] -> unit vectors of an encoder's width; `entries`, a power of 2, a level."""

    def __init__(
        self, centers: np.ndarray, width: int, entries: int = ENTRIES, *, numbers: int = NUMBERS, layers: int = LAYERS
    ) -> None:
        super().__init__()
        self.space = Space(centers)
        self.grid = HashGrid(entries, numbers)
        inputs = [self.grid.width + 1, *[HIDDEN] * layers]
        modules: list[nn.Module] = []
        for before, after in zip(inputs[:-1], inputs[1:], strict=True):
            modules += [nn.Linear(before, after), nn.ReLU()]
        self.width = width
        self.network = nn.Sequential(*modules, nn.Linear(HIDDEN, width))

    def forward(self, places: torch.Tensor, sizes: torch.Tensor) -> torch.Tensor:
        """Return (N, width) of places (N, 3) and sizes (N,)."""
        return nn.functional.normalize(self.raw(places, sizes), dim=1)

    def raw(self, places: torch.Tensor, sizes: torch.Tensor) -> torch.Tensor:
        """Return the same before it is made of length 1."""
        return self.network(torch.cat([self.grid(self.space(places)), sizes[:, None]], dim=1))

    def vectors(self, places: np.ndarray, size: float) -> np.ndarray:
        """Return (N, width) float32 of places (N, 3) at one size."""
        vectors_of_parts = []
        with torch.inference_mode():
            for start in range(0, len(places), CHUNK):
                part = torch.from_numpy(np.ascontiguousarray(places[start : start + CHUNK], np.float32))
                vectors_of_parts.append(self(part, torch.full((len(part),), float(size))).numpy())
        return np.concatenate(vectors_of_parts) if vectors_of_parts else np.zeros((0, self.width), np.float32)
