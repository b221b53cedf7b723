"""The recurrent units of the three scales, and the heads that move the disparity and spread it over full pixels."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from scenewright.stages.disparity.raft.architecture import Architecture
from torch import nn
from torch.nn import functional


class RecurrentUnit(nn.Module):
    """A gated recurrent unit of 3x3 convolutions."""

    def __init__(self, hidden: int, inputs: int) -> None:
        super().__init__()
        self.convz, self.convr, self.convq = (nn.Conv2d(hidden + inputs, hidden, 3, 1, 1) for _ in range(3))

    def forward(
        self, state: torch.Tensor, context: Sequence[torch.Tensor], inputs: Sequence[torch.Tensor]
    ) -> torch.Tensor:
        """Return the next state; `context` biases the update gate, the reset gate and the candidate."""
        update, reset = (
            torch.sigmoid(gate(torch.cat([state, *inputs], dim=1)) + bias)
            for gate, bias in zip((self.convz, self.convr), context, strict=False)
        )
        candidate = torch.tanh(self.convq(torch.cat([reset * state, *inputs], dim=1)) + context[2])
        return torch.lerp(state, candidate, update)


class MotionEncoder(nn.Module):
    """Correlations and the present flow (x, y; y is always 0) -> what the finest unit is told of them."""

    def __init__(self, sizes: Architecture) -> None:
        super().__init__()
        inside, outside = sizes.motion
        self.convc1 = nn.Conv2d(sizes.levels * (2 * sizes.radius + 1), inside, 1)
        self.convc2 = nn.Conv2d(inside, inside, 3, 1, 1)
        self.convf1 = nn.Conv2d(2, inside, 7, 1, 3)
        self.convf2 = nn.Conv2d(inside, inside, 3, 1, 1)
        self.conv = nn.Conv2d(2 * inside, outside - 2, 3, 1, 1)

    def forward(self, flow: torch.Tensor, correlation: torch.Tensor) -> torch.Tensor:
        """(N, 2, h, w), (N, planes, h, w) -> (N, outside, h, w), whose last two channels are the flow itself."""
        correlation_features = torch.relu(self.convc2(torch.relu(self.convc1(correlation))))
        flow_features = torch.relu(self.convf2(torch.relu(self.convf1(flow))))
        return torch.cat([torch.relu(self.conv(torch.cat([correlation_features, flow_features], dim=1))), flow], dim=1)


class FlowHead(nn.Module):
    """State -> change of the flow (x, y)."""

    def __init__(self, hidden: int, inside: int) -> None:
        super().__init__()
        self.conv1, self.conv2 = nn.Conv2d(hidden, inside, 3, 1, 1), nn.Conv2d(inside, 2, 3, 1, 1)

    def forward(self, state: torch.Tensor) -> torch.Tensor:
        """(N, hidden, h, w) -> (N, 2, h, w)."""
        return self.conv2(torch.relu(self.conv1(state)))


class UpdateBlock(nn.Module):
    """All recurrent units and heads."""

    def __init__(self, sizes: Architecture) -> None:
        super().__init__()
        fine, middle, coarse = sizes.hidden
        self.scales = sizes.scales
        self.encoder = MotionEncoder(sizes)
        self.gru08 = RecurrentUnit(fine, sizes.motion[1] + (middle if sizes.scales > 1 else 0))
        self.gru16 = RecurrentUnit(middle, fine + (coarse if sizes.scales > 2 else 0))
        self.gru32 = RecurrentUnit(coarse, middle)
        self.flow_head = FlowHead(fine, sizes.head)
        weights = 9 * 4**sizes.downsample
        self.mask = nn.Sequential(nn.Conv2d(fine, sizes.mask, 3, 1, 1), nn.ReLU(), nn.Conv2d(sizes.mask, weights, 1))

    def coarse_step(
        self, states: list[torch.Tensor], context: list[list[torch.Tensor]], only_coarsest: bool = False
    ) -> None:
        """Advance the coarser units in place, the coarsest first."""
        if self.scales > 2:
            states[2] = self.gru32(states[2], context[2], [shrunk(states[1])])
        if self.scales > 1 and not only_coarsest:
            above = [stretched(states[2], states[1])] if self.scales > 2 else []
            states[1] = self.gru16(states[1], context[1], [shrunk(states[0]), *above])

    def fine_step(
        self,
        states: list[torch.Tensor],
        context: list[list[torch.Tensor]],
        flow: torch.Tensor,
        correlation: torch.Tensor,
    ) -> torch.Tensor:
        """Advance the finest unit in place and return the change of the flow (N, 2, h, w)."""
        above = [stretched(states[1], states[0])] if self.scales > 1 else []
        states[0] = self.gru08(states[0], context[0], [self.encoder(flow, correlation), *above])
        return self.flow_head(states[0])

    def upsampling_weights(self, states: list[torch.Tensor]) -> torch.Tensor:
        """Return the weights (N, 9 * factor^2, h, w) of the nine cells around, before they are made to add up to 1."""
        return 0.25 * self.mask(states[0])


def shrunk(state: torch.Tensor) -> torch.Tensor:
    """Return a map at half the size."""
    return functional.avg_pool2d(state, 3, 2, 1)


def stretched(state: torch.Tensor, like: torch.Tensor) -> torch.Tensor:
    """Return a map at the size of another."""
    return functional.interpolate(state, like.shape[2:], mode="bilinear", align_corners=True)
