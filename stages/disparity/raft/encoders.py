"""The two encoders: features of both eyes to be correlated, and context of the left eye at three scales."""

from __future__ import annotations

import torch
from scenewright.stages.disparity.raft.architecture import Architecture
from torch import nn


def normalisation(channels: int, batch: bool) -> nn.Module:
    """Return batch normalisation, or instance normalisation without parameters."""
    return nn.BatchNorm2d(channels) if batch else nn.InstanceNorm2d(channels)


class Residual(nn.Module):
    """Two 3x3 convolutions beside a short cut, which is a 1x1 convolution where the shape changes."""

    def __init__(self, inside: int, outside: int, batch: bool, stride: int = 1) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(inside, outside, 3, stride, 1)
        self.conv2 = nn.Conv2d(outside, outside, 3, 1, 1)
        self.norm1, self.norm2 = normalisation(outside, batch), normalisation(outside, batch)
        self.downsample: nn.Module | None = None
        if stride != 1 or inside != outside:
            self.norm3 = normalisation(outside, batch)  # checkpoints hold it under this name too
            self.downsample = nn.Sequential(nn.Conv2d(inside, outside, 1, stride), self.norm3)

    def forward(self, given: torch.Tensor) -> torch.Tensor:
        """(N, inside, H, W) -> (N, outside, H / stride, W / stride)."""
        straight = given if self.downsample is None else self.downsample(given)
        for convolution, norm in ((self.conv1, self.norm1), (self.conv2, self.norm2)):
            given = torch.relu(norm(convolution(given)))
        return torch.relu(straight + given)


def stage(inside: int, outside: int, batch: bool, stride: int) -> nn.Sequential:
    """Return two residual blocks, the first of which may halve the size."""
    return nn.Sequential(Residual(inside, outside, batch, stride), Residual(outside, outside, batch))


class Trunk(nn.Module):
    """A 7x7 convolution and three stages. Of the four places that can halve the size, the last `downsample` do."""

    def __init__(self, sizes: Architecture, batch: bool) -> None:
        super().__init__()
        first, second, third = sizes.widths
        halves = [2 if sizes.downsample > k else 1 for k in (2, 1, 0)]
        self.conv1 = nn.Conv2d(3, first, 7, halves[0], 3)
        self.norm1 = normalisation(first, batch)
        self.layer1 = stage(first, first, batch, 1)
        self.layer2 = stage(first, second, batch, halves[1])
        self.layer3 = stage(second, third, batch, halves[2])

    def trunk(self, pictures: torch.Tensor) -> torch.Tensor:
        """(N, 3, H, W) -> (N, C, h, w) at the finest scale."""
        started = torch.relu(self.norm1(self.conv1(pictures)))
        return self.layer3(self.layer2(self.layer1(started)))


class FeatureEncoder(Trunk):
    """Features of a picture, of which inner products are meaningful."""

    def __init__(self, sizes: Architecture) -> None:
        super().__init__(sizes, batch=False)
        self.conv2 = nn.Conv2d(sizes.widths[2], sizes.features, 1)

    def forward(self, pictures: torch.Tensor) -> torch.Tensor:
        """(N, 3, H, W) -> (N, features, h, w)."""
        return self.conv2(self.trunk(pictures))


class ContextEncoder(Trunk):
    """Two maps a scale: the first state of the recurrent unit, and what it is told in every step."""

    def __init__(self, sizes: Architecture) -> None:
        super().__init__(sizes, batch=sizes.batch_norm)
        width, batch = sizes.widths[2], sizes.batch_norm
        self.layer4, self.layer5 = stage(width, width, batch, 2), stage(width, width, batch, 2)
        fine, middle, coarse = sizes.hidden

        def block(channels: int) -> nn.Sequential:
            return nn.Sequential(Residual(width, width, batch), nn.Conv2d(width, channels, 3, 1, 1))

        self.outputs08 = nn.ModuleList(block(fine) for _ in range(2))
        self.outputs16 = nn.ModuleList(block(middle) for _ in range(2))
        self.outputs32 = nn.ModuleList(nn.Conv2d(width, coarse, 3, 1, 1) for _ in range(2))

    def scales(self, finest: torch.Tensor, count: int) -> list[tuple[torch.Tensor, torch.Tensor]]:
        """(N, C, h, w) of the trunk -> (state, told) of the `count` finest scales."""
        heads = (self.outputs08, self.outputs16, self.outputs32)
        shrink = (self.layer4, self.layer5)
        states, features = [], finest
        for k in range(count):
            features = shrink[k - 1](features) if k else features
            state, context = (head(features) for head in heads[k])
            states.append((torch.tanh(state), torch.relu(context)))
        return states
