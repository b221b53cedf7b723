"""The network: pictures in, disparity out."""

from __future__ import annotations

import torch
from scenewright.stages.disparity.raft.architecture import Architecture
from scenewright.stages.disparity.raft.correlation import RowCorrelation
from scenewright.stages.disparity.raft.encoders import ContextEncoder, FeatureEncoder, Residual
from scenewright.stages.disparity.raft.update import UpdateBlock
from torch import nn
from torch.nn import functional

DIVISOR = 32
"""Pictures are padded to multiples of this [px]."""


class RaftStereo(nn.Module):
    """RAFT-Stereo: `forward` for one pair, `updates` for the training."""

    def __init__(self, sizes: Architecture | None = None) -> None:
        super().__init__()
        self.sizes = sizes = sizes or Architecture()
        self.cnet = ContextEncoder(sizes)
        self.update_block = UpdateBlock(sizes)
        self.context_zqr_convs = nn.ModuleList(
            nn.Conv2d(hidden, 3 * hidden, 3, 1, 1) for hidden in sizes.hidden[: sizes.scales]
        )
        if sizes.shared:
            width = sizes.widths[2]
            self.conv2 = nn.Sequential(Residual(width, width, False), nn.Conv2d(width, sizes.features, 3, 1, 1))
        else:
            self.fnet = FeatureEncoder(sizes)

    @torch.inference_mode()
    def forward(self, left: torch.Tensor, right: torch.Tensor, iterations: int) -> torch.Tensor:
        """Return the disparity (H, W) [px] of the left of two pictures (3, H, W) float, 0 to 255, RGB."""
        height, width = left.shape[1:]
        full = self.updates(padded(left[None]), padded(right[None]), iterations)[0][0]
        top, left_edge = (full.shape[0] - height) // 2, (full.shape[1] - width) // 2
        return full[top : top + height, left_edge : left_edge + width]

    def updates(
        self, left: torch.Tensor, right: torch.Tensor, iterations: int
    ) -> tuple[torch.Tensor, list[torch.Tensor]]:
        """Return the disparity (N, H, W) [px] of pictures (N, 3, H, W) whose sizes are multiples of DIVISOR, and the
        coarse disparities (N, h, w) [coarse px] after every update. Gradients stop between updates, as in the
        paper."""
        features, scales = self._encode(torch.cat([left, right]) * (2 / 255.0) - 1.0)
        states = [state for state, _ in scales]
        context = [
            list(convolution(scale_context).chunk(3, dim=1))
            for convolution, (_, scale_context) in zip(self.context_zqr_convs, scales, strict=True)
        ]
        first, second = features.float().chunk(2)
        with torch.autocast(features.device.type, enabled=False):
            correlation = RowCorrelation(first, second, self.sizes.levels, self.sizes.radius)
        start = torch.arange(first.shape[3], dtype=first.dtype, device=first.device)
        start = start.expand(first.shape[0], *first.shape[2:])
        column, disparities = start, []
        for _ in range(iterations):
            column = column.detach()
            flow = torch.stack([column - start, torch.zeros_like(start)], dim=1)
            if self.sizes.slow_fast:
                self.update_block.coarse_step(states, context, only_coarsest=True)
                self.update_block.coarse_step(states, context)
            self.update_block.coarse_step(states, context)
            change = self.update_block.fine_step(states, context, flow, correlation.at(column))
            column = column + change[:, 0].float()
            disparities.append(start - column)
        weights = self.update_block.upsampling_weights(states).float()
        return upsampled(disparities[-1][:, None], weights, 2**self.sizes.downsample), disparities

    def _encode(self, pictures: torch.Tensor) -> tuple[torch.Tensor, list[tuple[torch.Tensor, torch.Tensor]]]:
        count = len(pictures) // 2
        if self.sizes.shared:
            finest = self.cnet.trunk(pictures)
            return self.conv2(finest), self.cnet.scales(finest[:count], self.sizes.scales)
        return self.fnet(pictures), self.cnet.scales(self.cnet.trunk(pictures[:count]), self.sizes.scales)


def padded(pictures: torch.Tensor) -> torch.Tensor:
    """Return pictures (N, 3, H, W) with repeated borders, so that both sizes are multiples of DIVISOR."""
    extra_rows, extra_columns = (-pictures.shape[2]) % DIVISOR, (-pictures.shape[3]) % DIVISOR
    top, left = extra_rows // 2, extra_columns // 2
    return functional.pad(pictures, (left, extra_columns - left, top, extra_rows - top), mode="replicate")


def upsampled(coarse: torch.Tensor, weights: torch.Tensor, factor: int) -> torch.Tensor:
    """Return maps (N, 1, h, w) at `factor` times the size, (N, h * factor, w * factor): every pixel is a mean of the
    nine cells around its own, with `weights` (N, 9 * factor^2, h, w) through a softmax; values grow by the factor."""
    count, _, height, width = coarse.shape
    shares = torch.softmax(weights.reshape(count, 9, factor, factor, height, width), dim=1)
    cells = functional.unfold(factor * coarse, 3, padding=1).reshape(count, 9, 1, 1, height, width)
    spread = (shares * cells).sum(dim=1).permute(0, 3, 1, 4, 2)
    return spread.reshape(count, height * factor, width * factor)
