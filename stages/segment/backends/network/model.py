"""The network: a residual encoder, a decoder with skips, and three heads at half of the input's resolution.

Heads as in Panoptic-DeepLab (Cheng et al. 2020, section 3): class logits, a heat map of instance centres, and offsets
from every pixel to the centre of its instance. The encoder's blocks are those of He et al. 2016 (basic blocks with
batch normalisation); what is pooled over the whole image is added at the coarsest level, since the kind of a room says
much about what stands in it (Zhao et al. 2017).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import nn
from torch.nn import functional
from torch.nn.utils.fusion import fuse_conv_bn_eval

OFFSET_UNIT = 16.0
"""The last layer speaks of offsets in this unit [output pixels]: what it has to reach then lies around 1."""


@dataclass(frozen=True)
class Widths:
    """Channels of the encoder at strides 2, 4, 8, 16 and 32; the decoder has as many at each stride."""

    encoder: tuple[int, int, int, int, int] = (24, 48, 80, 128, 160)
    decoder: tuple[int, int, int, int] = (32, 64, 80, 128)
    blocks: int = 2
    """Residual blocks at strides 4 to 32."""


def _convolution(inputs: int, outputs: int, *, kernel: int = 3, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride=stride, padding=kernel // 2, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


def fold_normalization(network: nn.Module) -> nn.Module:
    """Let the convolutions of a network in evaluation do the work of the batch normalisations behind them; returns it.

    The same function but for rounding, in four fifths of the time (Jacob et al. 2018, section 3.2).
    """
    for module in network.modules():
        if isinstance(module, nn.Sequential):
            for place, (convolution, normalization) in enumerate(pairwise(list(module))):
                if isinstance(convolution, nn.Conv2d) and isinstance(normalization, nn.BatchNorm2d):
                    module[place] = fuse_conv_bn_eval(convolution, normalization)
                    module[place + 1] = nn.Identity()
    return network


class ResidualBlock(nn.Module):
    """Two 3x3 convolutions beside the identity (He et al. 2016, figure 2)."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first = _convolution(width, width)
        normalization = nn.BatchNorm2d(width)
        # A block begins as the identity (Goyal et al. 2017, section 5.1).
        nn.init.zeros_(normalization.weight)
        self.second = nn.Sequential(nn.Conv2d(width, width, 3, padding=1, bias=False), normalization)

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Return features of the same shape."""
        return functional.relu(features + self.second(self.first(features)))


class PanopticNetwork(nn.Module):
    """(N, inputs, H, W) to class logits (N, classes, h, w), centre heat map (N, 1, h, w), unbounded, and offsets
    (N, 2, h, w), rows then columns, in output pixels; h = ceil(H / 2), w = ceil(W / 2)."""

    def __init__(self, inputs: int, classes: int, widths: Widths | None = None) -> None:
        super().__init__()
        widths = widths or Widths()
        encoder, decoder = widths.encoder, widths.decoder
        self.stem = nn.Sequential(_convolution(inputs, encoder[0], stride=2), _convolution(encoder[0], encoder[0]))
        self.stages = nn.ModuleList(
            nn.Sequential(_convolution(before, after, stride=2), *(ResidualBlock(after) for _ in range(widths.blocks)))
            for before, after in zip(encoder[:-1], encoder[1:], strict=True)
        )
        self.context = nn.Sequential(nn.Linear(encoder[-1], encoder[-1]), nn.ReLU(inplace=True))
        coarser = (*decoder[1:], encoder[-1])
        self.narrow = nn.ModuleList(
            nn.Conv2d(above, width, 1, bias=False) for above, width in zip(coarser, decoder, strict=True)
        )
        self.skips = nn.ModuleList(
            nn.Conv2d(skip, width, 1, bias=False) for skip, width in zip(encoder[:-1], decoder, strict=True)
        )
        self.merge = nn.ModuleList(
            nn.Sequential(nn.BatchNorm2d(width), nn.ReLU(inplace=True), _convolution(width, width)) for width in decoder
        )
        self.semantic = nn.Sequential(_convolution(decoder[0], decoder[0]), nn.Conv2d(decoder[0], classes, 1))
        self.instance = nn.Sequential(_convolution(decoder[0], decoder[0]), nn.Conv2d(decoder[0], 3, 1))

    def forward(self, images: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return (logits, heat map, offsets)."""
        levels = [self.stem(images)]
        for stage in self.stages:
            levels.append(stage(levels[-1]))
        features = levels[-1]
        features = features + self.context(features.mean(dim=(2, 3)))[:, :, None, None]
        for level in reversed(range(len(self.merge))):
            skip = self.skips[level](levels[level])
            raised = functional.interpolate(
                self.narrow[level](features), size=skip.shape[2:], mode="bilinear", align_corners=False
            )
            features = self.merge[level](raised + skip)
        logits = self.semantic(features)
        instance = self.instance(features)
        return logits, instance[:, :1], instance[:, 1:] * OFFSET_UNIT
