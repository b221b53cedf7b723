"""Pictures of a batch as other cameras and other light would give them, on a processor or a GPU (torch)."""

from __future__ import annotations

import numpy as np
import torch
from scenewright.stages.segment.training.network.draws import Draws
from torch.nn import functional

REACH = 5
"""Radius of the kernels that blur [px]."""
LUMINANCE = (
    (16, 11, 10, 16, 24, 40, 51, 61),
    (12, 12, 14, 19, 26, 58, 60, 55),
    (14, 13, 16, 24, 40, 57, 69, 56),
    (14, 17, 22, 29, 51, 87, 80, 62),
    (18, 22, 37, 56, 68, 109, 103, 77),
    (24, 35, 55, 64, 81, 104, 113, 92),
    (49, 64, 78, 87, 103, 121, 120, 101),
    (72, 92, 95, 98, 112, 100, 103, 99),
)
"""ITU-T T.81, table K.1."""
CHROMINANCE = (
    (17, 18, 24, 47, 99, 99, 99, 99),
    (18, 21, 26, 66, 99, 99, 99, 99),
    (24, 26, 56, 99, 99, 99, 99, 99),
    (47, 66, 99, 99, 99, 99, 99, 99),
    *([(99,) * 8] * 4),
)
"""ITU-T T.81, table K.2."""
FROM_RGB = ((0.299, 0.587, 0.114), (-0.168736, -0.331264, 0.5), (0.5, -0.418688, -0.081312))
"""Matrix from RGB to luminance and two chrominances (JFIF)."""


def other_colors(color: torch.Tensor, draws: Draws, generator: torch.Generator) -> torch.Tensor:
    """Return pictures (B, 3, h, w), 0 to 255, of pictures 0 to 1, with other saturation, gains, contrast, gamma,
    defocus or motion blur, vignette, noise and JPEG."""

    def each(values: torch.Tensor) -> torch.Tensor:
        return values[:, None, None, None]

    grey = color.mean(1, keepdim=True)
    saturation = draws.uniform(0.3, 1.4) * ~draws.chance(0.08)
    color = grey + each(saturation) * (color - grey)
    gains = torch.stack([draws.uniform(0.75, 1.25) for _ in range(3)], dim=1)[:, :, None, None]
    color = color * each(draws.uniform(0.6, 1.5)) * gains
    color = (color - 0.5) * each(draws.uniform(0.6, 1.4)) + 0.5 + each(draws.uniform(-0.1, 0.1))
    color = color.clamp(1e-6, 1) ** each(torch.exp(draws.uniform(-0.5, 0.5)))
    color = _blurred(color, draws)
    across = torch.linspace(-1, 1, color.shape[3], device=color.device)
    down = torch.linspace(-1, 1, color.shape[2], device=color.device)[:, None]
    fall = each(draws.uniform(0, 0.5) * draws.chance(0.3)) / 2
    color = color * (1 - fall * ((across - each(draws.uniform(-1, 1))) ** 2 + down**2))
    noise = torch.randn(color.shape, generator=generator, device=color.device)
    shown = ((color + each(draws.uniform(0, 0.06)) * noise) * 255).round().clamp(0, 255)
    quality = draws.uniform(20, 90).round()
    return torch.where(each(draws.chance(0.3)), compressed(shown, quality), shown)


def _blurred(color: torch.Tensor, draws: Draws) -> torch.Tensor:
    """Return pictures a quarter of which are out of focus, another seventh moved."""
    side = torch.arange(-REACH, REACH + 1, device=color.device, dtype=torch.float32)
    v, u = side[:, None], side[None, :]
    deviation, angle, length = (
        draws.uniform(*limits)[:, None, None] for limits in ((0.4, 1.8), (0.0, np.pi), (1.5, 4.4))
    )
    along, aside = u * torch.cos(angle) + v * torch.sin(angle), v * torch.cos(angle) - u * torch.sin(angle)
    line = (1 - aside.abs()).clamp(min=0) * (along.abs() <= length)
    round_ = torch.exp(-(u**2 + v**2) / (2 * deviation**2))
    none = ((u == 0) & (v == 0)).to(torch.float32).expand_as(line)
    which = draws.uniform()[:, None, None]
    kernels = torch.where(which < 0.25, round_, torch.where(which < 0.4, line, none))
    kernels = kernels / kernels.sum((1, 2), keepdim=True)
    padded = functional.pad(color, (REACH,) * 4, mode="replicate").flatten(0, 1)[None]
    weight = kernels.repeat_interleave(3, dim=0)[:, None]
    return functional.conv2d(padded, weight, groups=len(weight))[0].reshape(color.shape)


def compressed(color: torch.Tensor, quality: torch.Tensor) -> torch.Tensor:
    """Return pictures (B, 3, h, w), 0 to 255, sides multiples of 16, after JPEG of a quality (B,) 1 to 100, with half
    the chrominance in either direction."""
    to_ycc = torch.tensor(FROM_RGB, device=color.device)
    luminance, *chrominance = torch.einsum("ij,bjhw->bihw", to_ycc, color).split(1, dim=1)
    scale = torch.where(quality < 50, 5000 / quality, 200 - 2 * quality)[:, None, None]
    coarse = functional.avg_pool2d(torch.cat(chrominance, dim=1), 2)
    coarse = torch.cat([_quantized(part, CHROMINANCE, scale) for part in coarse.split(1, dim=1)], dim=1)
    chroma = functional.interpolate(coarse, scale_factor=2.0, mode="bilinear", align_corners=False)
    whole = torch.cat([_quantized(luminance - 128, LUMINANCE, scale) + 128, chroma], dim=1)
    return torch.einsum("ij,bjhw->bihw", torch.linalg.inv(to_ycc), whole).round().clamp(0, 255)


def _quantized(image: torch.Tensor, table: tuple[tuple[int, ...], ...], scale: torch.Tensor) -> torch.Tensor:
    """Return an image (B, 1, h, w) whose blocks' cosine coefficients are whole multiples of steps."""
    count, _, height, width = image.shape
    steps = ((torch.tensor(table, device=image.device) * scale + 50) / 100).floor().clamp(1, 255)
    place = torch.arange(8, device=image.device, dtype=torch.float32)
    cosine = 0.5 * torch.cos((2 * place[None, :] + 1) * place[:, None] * torch.pi / 16)
    cosine[0] /= 2**0.5
    blocks = image.reshape(count, height // 8, 8, width // 8, 8).permute(0, 1, 3, 2, 4)
    coefficients = cosine @ blocks @ cosine.T
    quantum = steps[:, None, None]
    back = cosine.T @ ((coefficients / quantum).round() * quantum) @ cosine
    return back.permute(0, 1, 3, 2, 4).reshape(image.shape)
