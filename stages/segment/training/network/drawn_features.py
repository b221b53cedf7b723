"""The network's inputs (stages/segment/backends/network/features.py) of a batch, on a processor or a GPU (torch)."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from scenewright.stages.segment.backends.network.features import (
    LARGEST_HEIGHT,
    LARGEST_INVERSE_DEPTH,
    NORMAL_STEP,
    NORMAL_WINDOW,
    SMOOTHING_WINDOW,
)
from torch.nn import functional

DEVIATION, DISTANCE_FACTOR, LEAST_NEIGHBOURS = 0.009, 0.05, 4
"""As `smooth_depth` and `surface_normals` have them."""


@dataclass(frozen=True)
class CameraBatch:
    """Focal lengths and principal points of B cameras, (B,) each [pixels]."""

    fx: torch.Tensor
    fy: torch.Tensor
    cx: torch.Tensor
    cy: torch.Tensor


@dataclass(frozen=True)
class MountBatch:
    """What is known of how B cameras hang."""

    up: torch.Tensor
    """(B, 3) unit vectors against gravity in the camera frame; of any length but 0 where `has_gravity` is false."""
    height: torch.Tensor
    """(B,) over the floor [m]."""
    has_gravity: torch.Tensor
    """(B,) bool."""
    has_floor: torch.Tensor
    """(B,) bool, false where `has_gravity` is."""


def features_of(
    depth: torch.Tensor, color: torch.Tensor, has_color: torch.Tensor, cameras: CameraBatch, mounts: MountBatch
) -> torch.Tensor:
    """Return inputs (B, 16, H, W) of depths (B, H, W) [m] and colours (B, 3, H, W), 0 to 255, shown where `has_color`
    (B,) says so: what `features` gives of every one of them."""
    depth = smoothed(depth)
    height, width = depth.shape[1:]
    rays = rays_of(cameras, height, width)
    points = torch.cat([rays * depth[:, None], depth[:, None]], dim=1)
    valid = (depth > 0).to(depth.dtype)
    inverse = torch.where(depth > 0, 1.0 / depth.clamp(min=1e-3), 0.0).clamp(max=LARGEST_INVERSE_DEPTH)
    axes = viewing_axes(mounts)
    normals = torch.einsum("bij,bjhw->bihw", axes, normals_of(points))
    high = torch.einsum("bj,bjhw->bhw", axes[:, 1], points)
    over_floor = high + mounts.height[:, None, None]
    flags = [flag.to(depth.dtype)[:, None, None].expand_as(depth) for flag in (has_color, mounts.has_gravity)]
    floor = mounts.has_floor.to(depth.dtype)[:, None, None].expand_as(depth)
    return torch.stack(
        [
            *((color / 127.5 - 1.0) * flags[0][:, None]).unbind(1),
            flags[0],
            inverse - 0.5 * valid,
            valid,
            inverse * (cameras.fx / 260.0)[:, None, None],
            *normals.unbind(1),
            flags[1],
            high.clamp(-LARGEST_HEIGHT, LARGEST_HEIGHT) * valid,
            over_floor.clamp(-LARGEST_HEIGHT, LARGEST_HEIGHT) * valid * floor,
            floor,
            *rays.unbind(1),
        ],
        dim=1,
    )


def rays_of(cameras: CameraBatch, height: int, width: int) -> torch.Tensor:
    """Return (B, 2, H, W): x / z and y / z of every pixel."""
    device = cameras.fx.device
    across = (torch.arange(width, device=device) - cameras.cx[:, None]) / cameras.fx[:, None]
    down = (torch.arange(height, device=device) - cameras.cy[:, None]) / cameras.fy[:, None]
    return torch.stack([across[:, None, :].expand(-1, height, -1), down[:, :, None].expand(-1, -1, width)], dim=1)


def smoothed(depth: torch.Tensor) -> torch.Tensor:
    """Return depths (B, H, W) as `smooth_depth` does: bilateral on the inverse depth, in a round window."""
    half = SMOOTHING_WINDOW // 2
    inverse = torch.where(depth > 0, 1.0 / torch.where(depth > 0, depth, 1.0), -1000.0)
    padded = functional.pad(inverse[:, None], (half,) * 4, mode="replicate")[:, 0]
    height, width = depth.shape[1:]
    total, weights = torch.zeros_like(depth), torch.zeros_like(depth)
    for dv in range(-half, half + 1):
        for du in range(-half, half + 1):
            away = dv * dv + du * du
            if away > half * half:
                continue
            there = padded[:, half + dv : half + dv + height, half + du : half + du + width]
            spatial = -0.5 * away / (SMOOTHING_WINDOW / 3) ** 2
            weight = torch.exp(spatial - 0.5 * ((there - inverse) / DEVIATION) ** 2)
            total += weight * there
            weights += weight
    smooth = total / weights
    return torch.where((depth > 0) & (smooth > 1e-4), 1.0 / smooth.clamp(min=1e-4), 0.0)


def normals_of(points: torch.Tensor) -> torch.Tensor:
    """Return (B, 3, H, W) of points (B, 3, H, W) [m] as `surface_normals` does: the direction of least variance."""
    half = NORMAL_WINDOW // 2 // NORMAL_STEP * NORMAL_STEP
    height, width = points.shape[2:]
    z = points[:, 2]
    reach = (DISTANCE_FACTOR * z) ** 2
    padded = functional.pad(points, (half,) * 4)
    count = torch.zeros_like(z)
    sums, products = torch.zeros_like(points), [torch.zeros_like(z) for _ in range(6)]
    for dv in range(-half, half + 1, NORMAL_STEP):
        for du in range(-half, half + 1, NORMAL_STEP):
            there = padded[:, :, half + dv : half + dv + height, half + du : half + du + width]
            step = there - points
            taken = ((there[:, 2] > 0) & ((step**2).sum(1) <= reach)).to(z.dtype)
            step = step * taken[:, None]
            count += taken
            sums += step
            x, y, w = step.unbind(1)
            for total, product in zip(products, (x * x, x * y, x * w, y * y, y * w, w * w), strict=True):
                total += product
    known = (z > 0) & (count >= LEAST_NEIGHBOURS)
    mean = sums / count.clamp(min=1)[:, None]
    mx, my, mz = mean.unbind(1)
    n = count.clamp(min=1)
    pairs = ((mx, mx), (mx, my), (mx, mz), (my, my), (my, mz), (mz, mz))
    # In double precision: what is least differs from the others by little beside them.
    xx, xy, xz, yy, yz, zz = (
        (total / n - first * second).double() for total, (first, second) in zip(products, pairs, strict=True)
    )
    normal = _least_direction(xx, xy, xz, yy, yz, zz).to(z.dtype)
    normal = normal * torch.where((normal * points).sum(1) > 0, -1.0, 1.0)[:, None]
    return torch.where(known[:, None], normal, 0.0)


def _least_direction(
    xx: torch.Tensor, xy: torch.Tensor, xz: torch.Tensor, yy: torch.Tensor, yz: torch.Tensor, zz: torch.Tensor
) -> torch.Tensor:
    """Return unit eigenvectors (B, 3, H, W) of the smallest eigenvalues, in closed form (Smith 1961); 0 where nothing
    varies."""
    mean = (xx + yy + zz) / 3
    spread = (xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2 + 2 * (xy * xy + xz * xz + yz * yz)
    scale = (spread / 6).sqrt()
    safe = scale.clamp(min=1e-30)
    a, b, c, d, e, f = ((part / safe) for part in (xx - mean, yy - mean, zz - mean, xy, xz, yz))
    determinant = 0.5 * (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e))
    angle = torch.acos(determinant.clamp(-1, 1)) / 3
    least = mean + 2 * scale * torch.cos(angle + 2 * torch.pi / 3)
    rows = (
        torch.stack([xx - least, xy, xz], 1),
        torch.stack([xy, yy - least, yz], 1),
        torch.stack([xz, yz, zz - least], 1),
    )
    crosses = torch.stack([torch.linalg.cross(rows[i], rows[j], dim=1) for i, j in ((0, 1), (0, 2), (1, 2))])
    lengths = (crosses**2).sum(2)
    longest = lengths.argmax(0)[None, :, None].expand(1, *crosses.shape[1:])
    chosen = crosses.gather(0, longest)[0]
    length = lengths.max(0).values.sqrt()[:, None]
    return torch.where((length > 0) & (scale > 0)[:, None], chosen / length.clamp(min=1e-300), 0.0)


def viewing_axes(mounts: MountBatch) -> torch.Tensor:
    """Return (B, 3, 3) with the rows right, up and forward in the camera frames, as `viewing_axes` of one."""
    up = functional.normalize(mounts.up, dim=1)
    device = up.device
    x, y = (torch.tensor(axis, device=device).expand_as(up) for axis in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    across = torch.where((up[:, :1].abs() < 0.9), x, y)
    right = functional.normalize(across - (across * up).sum(1, keepdim=True) * up, dim=1)
    axes = torch.stack([right, up, torch.linalg.cross(up, right, dim=1)], dim=1)
    own = torch.tensor([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]], device=device)
    return torch.where(mounts.has_gravity[:, None, None], axes, own)
