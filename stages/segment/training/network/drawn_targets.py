"""What the heads are to say (targets.py) of a batch, on a processor or a GPU (torch)."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from scenewright.stages.segment.training.network.targets import IGNORED, SIGMA, SMALL_AREA, SMALL_WEIGHT


@dataclass(frozen=True)
class TargetBatch:
    """As `Targets`, each (B, ..., h, w)."""

    classes: torch.Tensor
    """int64"""
    weight: torch.Tensor
    centres: torch.Tensor
    offsets: torch.Tensor
    things: torch.Tensor
    """bool"""
    told: torch.Tensor
    """bool"""


def targets_of(labels: torch.Tensor, class_of_label: torch.Tensor, thing_of_label: torch.Tensor) -> TargetBatch:
    """Return what `make_targets` gives of every image of labels (B, h, w) int64 with its tables (B, L)."""
    count, height, width = labels.shape
    device, flat, kinds = labels.device, labels.reshape(labels.shape[0], -1), class_of_label.shape[1]
    classes = class_of_label.gather(1, flat).reshape(labels.shape)
    things = thing_of_label.gather(1, flat).reshape(labels.shape)
    row, column = (
        axis.to(torch.float32).expand(height, width)
        for axis in (torch.arange(height, device=device)[:, None], torch.arange(width, device=device)[None, :])
    )
    zeros = torch.zeros((count, kinds), device=device)
    areas = zeros.scatter_add(1, flat, torch.ones_like(flat, dtype=torch.float32))
    middles = [
        zeros.scatter_add(1, flat, axis.reshape(1, -1).expand(count, -1).contiguous()) / areas.clamp(min=1)
        for axis in (row, column)
    ]
    offsets = torch.stack(
        [
            (middle.gather(1, flat).reshape(labels.shape) - axis) * things
            for middle, axis in zip(middles, (row, column), strict=True)
        ],
        dim=1,
    )
    small = (areas.gather(1, flat).reshape(labels.shape) < SMALL_AREA) & things
    weight = torch.where(small, SMALL_WEIGHT, 1.0)
    centres = _bumps(areas, middles, thing_of_label & (areas > 0), (height, width))
    return TargetBatch(classes, weight, centres, offsets, things, (classes != IGNORED) | things)


def _bumps(
    areas: torch.Tensor, middles: list[torch.Tensor], drawn: torch.Tensor, shape: tuple[int, int]
) -> torch.Tensor:
    """Return heat maps (B, h, w): the highest of the bumps about the middles (B, L) of what is `drawn` (B, L)."""
    (height, width), device = shape, areas.device
    sigma = (0.3 * areas.sqrt()).clamp(1.0, SIGMA)[..., None]
    reach = (3 * sigma).ceil()
    side = torch.arange(-3 * int(SIGMA), 3 * int(SIGMA) + 1, device=device, dtype=torch.float32)
    around = torch.cartesian_prod(side, side)
    row, column = (middle.round()[..., None] + around[:, k] for k, middle in enumerate(middles))
    away = (row - middles[0][..., None]) ** 2 + (column - middles[1][..., None]) ** 2
    inside = (row >= 0) & (row < height) & (column >= 0) & (column < width) & drawn[..., None]
    inside &= (around.abs().amax(1) <= reach) & inside
    value = torch.where(inside, torch.exp(-away / (2 * sigma**2)), 0.0)
    place = (row.clamp(0, height - 1) * width + column.clamp(0, width - 1)).long()
    heat = torch.zeros((len(areas), height * width), device=device)
    return heat.scatter_reduce(1, place.flatten(1), value.flatten(1), "amax").reshape(-1, height, width)
