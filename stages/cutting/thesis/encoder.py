"""Shape features (section 6.3.4): points, average pool, trained with a decoder of occupancy as IM-Net is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from scenewright.stages.cutting.corpus import queries, sampled
from scenewright.stages.cutting.learning import fit, layers, seeded
from scenewright.stages.cutting.world.body import Body
from scenewright.stages.cutting.world.canonical import Canonical, canonical

CODE = 16
"""Numbers of a shape's code; widths are not stated in the thesis: by eye."""
STEPS, BATCH = 800, 24
"""Steps of the training and shapes of a step; not stated in the thesis: by eye."""


class Encoder(torch.nn.Module):
    """Points with normals (B, P, 6) -> code (B, 16)."""

    def __init__(self) -> None:
        super().__init__()
        self.points = layers(6, 64, 128)
        self.code = torch.nn.Linear(128, CODE)

    def forward(self, surfaces: torch.Tensor) -> torch.Tensor:
        """Encode."""
        return self.code(torch.relu(self.points(surfaces)).mean(dim=1))


class _AutoEncoder(torch.nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.encoder = Encoder()
        self.decoder = layers(CODE + 3, 128, 128, 1)

    def forward(self, surfaces: torch.Tensor, places: torch.Tensor) -> torch.Tensor:
        code = self.encoder(surfaces)[:, None].expand(-1, places.shape[1], -1)
        return self.decoder(torch.cat([code, places], dim=2))[..., 0]


def train_encoder(shapes: Sequence[Canonical], seed: int, steps: int = STEPS) -> Encoder:
    """Return an encoder trained on fragments."""
    random = seeded(seed, 1)
    network = _AutoEncoder()
    surfaces = torch.from_numpy(sampled(shapes).surfaces)
    places, inside = (torch.from_numpy(values) for values in queries(shapes, random))

    def loss(chosen: np.ndarray) -> torch.Tensor:
        answer = network(surfaces[chosen], places[chosen])
        return torch.nn.functional.binary_cross_entropy_with_logits(answer, inside[chosen])

    fit(network, loss, len(shapes), random, steps=steps, batch=BATCH)
    return network.encoder


class Features:
    """z = (shape, scale), 17 numbers, each brought to mean 0 and deviation 1 over the training fragments."""

    def __init__(self, encoder: Encoder, mean: np.ndarray, deviation: np.ndarray) -> None:
        self.encoder, self.mean, self.deviation = encoder, mean, deviation

    @staticmethod
    def fitted(encoder: Encoder, shapes: Sequence[Canonical]) -> Features:
        """Return features scaled on training fragments."""
        raw = _raw(encoder, shapes)
        return Features(encoder, raw.mean(axis=0), np.maximum(raw.std(axis=0), 1e-6))

    def of_shapes(self, shapes: Sequence[Canonical]) -> np.ndarray:
        """Return z (N, 17) of fragments."""
        return np.asarray((_raw(self.encoder, shapes) - self.mean) / self.deviation)

    def of(self, bodies: Sequence[Body]) -> np.ndarray:
        """Return z (N, 17) of bodies."""
        return self.of_shapes([canonical(body) for body in bodies])


@torch.no_grad()
def _raw(encoder: Encoder, shapes: Sequence[Canonical]) -> np.ndarray:
    samples = sampled(shapes)
    code = encoder(torch.from_numpy(samples.surfaces)).numpy().astype(float)
    return np.column_stack([code, np.log(samples.scales)])
