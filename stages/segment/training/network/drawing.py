"""Samples of stored frames, drawn a batch at a time on a processor or a GPU (torch): crops, mirroring, lost colour,
lost gravity, other tones and noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from scenewright.stages.segment.backends.network.features import STRIDE
from scenewright.stages.segment.training.network.drawn_colors import other_colors
from scenewright.stages.segment.training.network.drawn_features import CameraBatch, MountBatch, features_of
from scenewright.stages.segment.training.network.drawn_targets import TargetBatch, targets_of
from scenewright.stages.segment.training.network.draws import Draws
from scenewright.stages.segment.training.network.samples import Frames
from scenewright.stages.segment.training.network.shards import HEIGHT, WIDTH
from torch.nn import functional

CROP_WIDTH, CROP_HEIGHT = 256, 192
COLOR_DROPOUT, GRAVITY_DROPOUT, FLOOR_DROPOUT = 0.35, 0.3, 0.35
"""Shares of samples that are shown without colour, without gravity, and of those with gravity without the floor."""
BLIND = 15
"""Where for so many pixels around neither colour nor depth says anything, nothing can be asked of the network."""


@dataclass(frozen=True)
class Window:
    """The part of B frames that is shown, as places (B, h) and (B, w) in them [pixels]."""

    rows: torch.Tensor
    columns: torch.Tensor


def drawn(frames: Frames, random: np.random.Generator, *, whole: bool) -> tuple[torch.Tensor, TargetBatch]:
    """Return inputs (B, 16, h, w) and targets of frames that are changed at random: crops of 256x192 pixels out of them
    (at up to 1.25 times coarser pixels), or with `whole` all of them; mirrored; other colours; wrong or no gravity."""
    device = frames.depth.device
    draws = Draws(random, len(frames.depth), device)
    window, cameras, mirrored = _window(frames.cameras, draws, whole)
    depth, labels = (_nearest(pixels, window) for pixels in (frames.depth, frames.labels))
    depth = _without_background(depth, draws)
    up = frames.up * torch.where(mirrored[:, None], torch.tensor([-1.0, 1.0, 1.0], device=device), 1.0)
    mounts = _mounts(up, frames.height, draws)
    moved = draws.chance(0.3)
    # As in logs whose colour is not registered to the depth.
    shift = [(draws.uniform(-4.5, 4.5).round() * moved)[:, None] for _ in range(2)]
    color = _bilinear(frames.color, Window(window.rows + shift[0], window.columns + shift[1]))
    generator = torch.Generator(device).manual_seed(int(random.integers(2**62)))
    shown = ~draws.chance(COLOR_DROPOUT)
    inputs = features_of(depth, other_colors(color, draws, generator), shown, cameras, mounts)
    blind = functional.max_pool2d((depth > 0).to(depth.dtype)[:, None], BLIND, 1, BLIND // 2)[:, 0] == 0
    told = torch.where(blind & ~shown[:, None, None], 0, labels.long())[:, ::STRIDE, ::STRIDE].contiguous()
    return inputs, targets_of(told, frames.class_of_label, frames.thing_of_label)


def _window(cameras: CameraBatch, draws: Draws, whole: bool) -> tuple[Window, CameraBatch, torch.Tensor]:
    """Return what is shown, the cameras that would show it, and which (B,) of it is mirrored."""
    device = cameras.fx.device
    share = draws.uniform(CROP_WIDTH / WIDTH, 1.0)
    size = [torch.ones_like(share) * side if whole else (side * share).round() for side in (HEIGHT, WIDTH)]
    shape = (HEIGHT, WIDTH) if whole else (CROP_HEIGHT, CROP_WIDTH)
    first = [
        (draws.uniform() * (side - own + 1)).floor().clamp(max=side - own)
        for side, own in zip((HEIGHT, WIDTH), size, strict=True)
    ]
    mirrored = draws.chance(0.5)
    rows, columns = (
        low[:, None] + (torch.arange(count, device=device) + 0.5) * (own / count)[:, None] - 0.5
        for low, own, count in zip(first, size, shape, strict=True)
    )
    columns = torch.where(mirrored[:, None], columns.flip(1), columns)
    factor = [count / own for count, own in zip(shape, size, strict=True)]
    cx = (cameras.cx - first[1] + 0.5) * factor[1] - 0.5
    shown = CameraBatch(
        cameras.fx * factor[1],
        cameras.fy * factor[0],
        torch.where(mirrored, shape[1] - 1 - cx, cx),
        (cameras.cy - first[0] + 0.5) * factor[0] - 0.5,
    )
    return Window(rows, columns), shown, mirrored


def _nearest(pixels: torch.Tensor, window: Window) -> torch.Tensor:
    """Return (B, h, w) of images (B, H, W)."""
    height, width = pixels.shape[1:]
    rows, columns = (window.rows + 0.5).floor().long(), (window.columns + 0.5).floor().long()
    which = torch.arange(len(pixels), device=pixels.device)[:, None, None]
    return pixels[which, rows.clamp(0, height - 1)[:, :, None], columns.clamp(0, width - 1)[:, None, :]]


def _bilinear(color: torch.Tensor, window: Window) -> torch.Tensor:
    """Return (B, 3, h, w) of pictures (B, H, W, 3), 0 to 1; beyond the edge there is the edge."""
    height, width = color.shape[1:3]
    which = torch.arange(len(color), device=color.device)[:, None, None]
    firsts = [places.floor() for places in (window.rows, window.columns)]
    total = torch.zeros((), device=color.device)
    for dr in (0, 1):
        for dc in (0, 1):
            r, c = firsts[0].long() + dr, firsts[1].long() + dc
            values = color[which, r.clamp(0, height - 1)[:, :, None], c.clamp(0, width - 1)[:, None, :]]
            weight = (1 - dr - (window.rows - firsts[0])).abs()[:, :, None] * (
                1 - dc - (window.columns - firsts[1])
            ).abs()[:, None, :]
            total = total + weight[..., None] * values
    return total.permute(0, 3, 1, 2) / 255.0


def _without_background(depth: torch.Tensor, draws: Draws) -> torch.Tensor:
    """Return depths (B, h, w), a quarter of them without what lies beyond a random distance."""
    cut, share = draws.chance(0.25), draws.uniform(0.4, 1.0)
    ordered = torch.where(depth > 0, depth, torch.inf).flatten(1).sort(dim=1).values
    valid = (depth > 0).flatten(1).sum(1)
    place = (share * (valid - 1).clamp(min=0)).long()
    limit = 1.05 * ordered.gather(1, place[:, None])[:, 0]
    return torch.where((cut & (valid > 0))[:, None, None] & (depth > limit[:, None, None]), 0.0, depth)


def _mounts(up: torch.Tensor, height: torch.Tensor, draws: Draws) -> MountBatch:
    """Return what is told of how the cameras hang: not always, and never exactly."""
    has_gravity = (up != 0).any(1) & ~draws.chance(GRAVITY_DROPOUT)
    tilted = up + torch.stack([draws.normal(0.025) for _ in range(3)], dim=1)
    has_floor = has_gravity & ~draws.chance(FLOOR_DROPOUT)
    return MountBatch(tilted, height + draws.normal(0.03), has_gravity, has_floor)
