"""The network: a U-Net that works at half of the picture's resolution and answers at the whole.

The form is that of Ronneberger et al. 2015 (encoder, decoder, skips), with batch normalisation and few channels. A
2 x 2 block of pixels goes in as twelve channels and comes out as four answers a class (Shi et al. 2016): a thread two
pixels wide keeps its place between the pixels, and most of the work is done on a quarter of them.
"""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional

CLASSES = ("needle", "thread", "driver")
"""What the three channels answer; drivers are asked for so that bright jaws are learned not to be needle."""
WIDTHS = (16, 24, 40, 64, 80)
"""Channels at strides 2, 4, 8, 16 and 32."""
STRIDE = 2 ** len(WIDTHS)
"""Sides of the input must be multiples of this."""


def _convolution(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, padding=1, bias=False), nn.BatchNorm2d(outputs), nn.ReLU(inplace=True)
    )


def _block(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(_convolution(inputs, outputs), _convolution(outputs, outputs))


class SutureNetwork(nn.Module):
    """Pictures (N, 3, H, W), numbers about 0, to logits (N, 3, H, W) of CLASSES; H and W are multiples of STRIDE."""

    def __init__(self, widths: tuple[int, ...] = WIDTHS) -> None:
        super().__init__()
        self.widths = tuple(widths)
        self.down = nn.ModuleList(
            _block(before, after) for before, after in zip((12, *widths[:-1]), widths, strict=True)
        )
        self.up = nn.ModuleList(
            _convolution(below + width, width) for width, below in zip(widths[:-1], widths[1:], strict=True)
        )
        self.answer = nn.Conv2d(widths[0], 4 * len(CLASSES), 1)
        nn.init.constant_(self.answer.bias, -3.0)  # type: ignore[arg-type]

    def forward(self, pictures: torch.Tensor) -> torch.Tensor:
        """Return the logits."""
        features = functional.pixel_unshuffle(pictures, 2)
        levels = []
        for index, block in enumerate(self.down):
            features = block(features if index == 0 else functional.max_pool2d(features, 2))
            levels.append(features)
        for index in reversed(range(len(self.up))):
            raised = functional.interpolate(features, scale_factor=2.0, mode="nearest")
            features = self.up[index](torch.cat([levels[index], raised], dim=1))
        return functional.pixel_shuffle(self.answer(features), 2)
