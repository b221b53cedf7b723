"""Small networks: plain layers, and fitting them from a seed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch


def layers(*widths: int) -> torch.nn.Sequential:
    """Return fully connected layers of these widths with ReLU between them."""
    modules: list[torch.nn.Module] = []
    for first, second in zip(widths[:-1], widths[1:], strict=True):
        modules += [torch.nn.Linear(first, second), torch.nn.ReLU()]
    return torch.nn.Sequential(*modules[:-1])


def fit(
    network: torch.nn.Module,
    loss: Callable[[np.ndarray], torch.Tensor],
    samples: int,
    random: np.random.Generator,
    *,
    steps: int,
    batch: int,
    rate: float = 1e-3,
) -> None:
    """Minimise a loss of drawn sample numbers by Adam, on one thread: the same seed gives the same numbers."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        optimizer = torch.optim.Adam(network.parameters(), lr=rate)
        network.train()
        for _ in range(steps):
            optimizer.zero_grad()
            loss(random.integers(samples, size=min(batch, samples))).backward()  # type: ignore[no-untyped-call]
            optimizer.step()
        network.eval()
    finally:
        torch.set_num_threads(threads)


def seeded(seed: int, *stream: int) -> np.random.Generator:
    """Return a generator, and seed torch's own from it: initial weights follow from the seed too."""
    random = np.random.default_rng([seed, *stream])
    torch.manual_seed(int(random.integers(2**31)))
    return random


class MixtureOfPlanes(torch.nn.Module):
    """A mixture density network of two layers (Bishop 1994) over planes in the canonical frame of a fragment.

    A plane is (n, d / scale): n turned so that its largest component is positive.
    """

    COMPONENTS = 4
    LEAST_DEVIATION = 0.02

    def __init__(self, inputs: int, width: int = 64) -> None:
        super().__init__()
        self.body = layers(inputs, width, self.COMPONENTS * 9)

    def forward(self, given: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return logarithms of weights (B, C), means (B, C, 4), deviations (B, C, 4)."""
        out = self.body(given).reshape(-1, self.COMPONENTS, 9)
        deviation = torch.nn.functional.softplus(out[..., 5:] - 1.0) + self.LEAST_DEVIATION
        return torch.log_softmax(out[..., 0], dim=1), out[..., 1:5], deviation

    def loss(self, given: torch.Tensor, planes: torch.Tensor) -> torch.Tensor:
        """Return the mean negative logarithm of the density of planes (B, 4)."""
        weight, mean, deviation = self(given)
        off = (planes[:, None] - mean) / deviation
        density = weight - (0.5 * off**2 + torch.log(deviation)).sum(dim=2)
        return -torch.logsumexp(density, dim=1).mean()

    @torch.no_grad()
    def draw(self, given: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """Return a plane (4,) drawn for one input (inputs,), its normal of length 1."""
        weight, mean, deviation = (
            values[0].numpy().astype(float) for values in self(torch.from_numpy(given.astype(np.float32))[None])
        )
        chances = np.exp(weight)
        k = int(random.choice(self.COMPONENTS, p=chances / chances.sum()))
        plane = random.normal(mean[k], deviation[k])
        length = float(np.linalg.norm(plane[:3]))
        return np.asarray(np.append(plane[:3] / max(length, 1e-6), plane[3]))
