"""The definition in code: torch, double precision, differentiated automatically. Slow: a loop over tiles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from scenewright.stages.kit.rendering.splatting import rasterizer
from scenewright.stages.kit.rendering.splatting.gaussians import GaussianGradients, Gaussians
from scenewright.stages.kit.rendering.splatting.harmonics import view_basis
from scenewright.stages.kit.rendering.splatting.rasterizer import Picture, View

TILE = 16
"""Edge of the squares of pixels that are blended at a time [px]."""


class ReferenceRasterizer:
    """Draws with torch in double precision."""

    def draw(self, gaussians: Gaussians, view: View) -> ReferenceDrawn:
        """Return what the view shows."""
        leaves = {
            name: torch.tensor(array, dtype=torch.float64, requires_grad=True)
            for name, array in gaussians.arrays().items()
        }
        twist = torch.zeros(6, dtype=torch.float64, requires_grad=True)
        basis = view_basis(gaussians.means.astype(float), view.camera_from_world, gaussians.harmonics.shape[1])
        colors = torch.clamp(torch.einsum("nk,nkc->nc", torch.tensor(basis), leaves["harmonics"]) + 0.5, min=0.0)
        flat = project(leaves, twist, view)
        flat.centers.retain_grad()
        values = torch.cat([colors, flat.depths[:, None], leaves["features"]], dim=1)
        image, alpha, visible = blend(flat, values, view)
        return ReferenceDrawn(leaves, twist, flat.centers, image, alpha, visible.numpy())


@dataclass(frozen=True)
class Flat:
    """Gaussians in the picture."""

    centers: torch.Tensor
    """(N, 2) [px]."""
    covariances: torch.Tensor
    """(N, 2, 2) [px^2]."""
    depths: torch.Tensor
    """(N,) [m]."""
    opacities: torch.Tensor
    """(N,)."""


def rotations(quaternions: torch.Tensor) -> torch.Tensor:
    """Return rotation matrices (N, 3, 3) of quaternions (N, 4), w x y z, of any length."""
    w, x, y, z = (quaternions / quaternions.norm(dim=1, keepdim=True)).T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return torch.stack([torch.stack(row, dim=-1) for row in rows], dim=-2)


def moved(camera_from_world: np.ndarray, twist: torch.Tensor) -> torch.Tensor:
    """Return the pose (4, 4) after a motion (6,), translation and rotation, that is small: to first order."""
    pose = torch.tensor(camera_from_world, dtype=twist.dtype, device=twist.device)
    zero = torch.zeros((), dtype=twist.dtype, device=twist.device)
    (x, y, z), (a, b, c) = twist[:3], twist[3:]
    rows = ((zero, -c, b, x), (c, zero, -a, y), (-b, a, zero, z), (zero, zero, zero, zero))
    return pose + torch.stack([torch.stack(row) for row in rows]) @ pose


def project(leaves: dict[str, torch.Tensor], twist: torch.Tensor, view: View) -> Flat:
    """Return centres and covariances in the picture (Zwicker et al. 2001, equation 31)."""
    camera = view.camera
    pose = moved(view.camera_from_world, twist)
    rotation, translation = pose[:3, :3], pose[:3, 3]
    x, y, z = (leaves["means"] @ rotation.T + translation).T
    depth = torch.where(z > rasterizer.NEAR, z, torch.ones_like(z))
    left, right, top, bottom = rasterizer.direction_limits(camera)
    across, along = torch.clamp(x / depth, left, right), torch.clamp(y / depth, top, bottom)
    nothing = torch.zeros_like(z)
    jacobian = torch.stack(
        [
            camera.fx / depth,
            nothing,
            -camera.fx * across / depth,
            nothing,
            camera.fy / depth,
            -camera.fy * along / depth,
        ],
        dim=1,
    ).reshape(-1, 2, 3)
    half = jacobian @ rotation @ rotations(leaves["quaternions"]) * torch.exp(leaves["log_scales"])[:, None, :]
    covariances = half @ half.transpose(1, 2) + rasterizer.DILATION * torch.eye(2, dtype=torch.float64)
    centers = torch.stack([camera.fx * x / depth + camera.cx, camera.fy * y / depth + camera.cy], dim=1)
    return Flat(centers, covariances, z, torch.sigmoid(leaves["logit_opacities"]))


def blend(flat: Flat, values: torch.Tensor, view: View) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return channels (H, W, C), alpha (H, W), and who reaches into the picture (N,), of values (N, C)."""
    camera = view.camera
    with torch.no_grad():
        power = 2.0 * torch.log(torch.clamp(flat.opacities / rasterizer.SMALLEST_ALPHA, min=1.0))
        reach = torch.sqrt(power[:, None] * torch.diagonal(flat.covariances, dim1=1, dim2=2))
        first, last = torch.ceil(flat.centers - reach), torch.floor(flat.centers + reach)
        edge = torch.tensor([camera.width - 1, camera.height - 1])
        is_drawn = (flat.depths > rasterizer.NEAR) & (power > 0)
        is_drawn &= ((first <= last) & (last >= 0) & (first <= edge)).all(dim=1)
        order = torch.argsort(flat.depths, stable=True)
        order = order[is_drawn[order]]
    conics = torch.linalg.inv(flat.covariances)
    background = torch.zeros(values.shape[1], dtype=torch.float64)
    background[:3] = torch.tensor(view.background, dtype=torch.float64)
    rows = []
    for top in range(0, camera.height, TILE):
        tiles = []
        for left in range(0, camera.width, TILE):
            low = torch.tensor([left, top])
            high = torch.tensor([min(left + TILE, camera.width) - 1, min(top + TILE, camera.height) - 1])
            in_tile = order[((last[order] >= low) & (first[order] <= high)).all(dim=1)]
            grid = torch.meshgrid(
                torch.arange(top, int(high[1]) + 1), torch.arange(left, int(high[0]) + 1), indexing="ij"
            )
            pixels = torch.stack([grid[1], grid[0]], dim=-1).double()
            tiles.append(_tile(pixels, flat, conics, values, in_tile, background))
        rows.append(torch.cat(tiles, dim=1))
    image = torch.cat(rows, dim=0)
    return image[..., :-1], image[..., -1], is_drawn


def _tile(
    pixels: torch.Tensor,
    flat: Flat,
    conics: torch.Tensor,
    values: torch.Tensor,
    in_tile: torch.Tensor,
    background: torch.Tensor,
) -> torch.Tensor:
    """Return channels and alpha (h, w, C + 1) of pixels (h, w, 2), Gaussians `in_tile` given from front to back."""
    offset = pixels[:, :, None, :] - flat.centers[in_tile]
    distance = torch.einsum("hwni,nij,hwnj->hwn", offset, conics[in_tile], offset)
    alpha = torch.clamp(flat.opacities[in_tile] * torch.exp(-0.5 * distance), max=rasterizer.LARGEST_ALPHA)
    alpha = torch.where(alpha >= rasterizer.SMALLEST_ALPHA, alpha, torch.zeros_like(alpha))
    after = torch.cumprod(1.0 - alpha, dim=2)
    alpha = torch.where(after > rasterizer.LEAST_TRANSMITTANCE, alpha, torch.zeros_like(alpha))
    after = torch.cumprod(1.0 - alpha, dim=2)
    before = torch.cat([torch.ones_like(after[..., :1]), after[..., :-1]], dim=2)
    transmittance = after[..., -1:] if len(in_tile) else torch.ones_like(pixels[..., :1])
    image = (alpha * before[..., : len(in_tile)]) @ values[in_tile] + transmittance * background
    return torch.cat([image, 1.0 - transmittance], dim=2)


class ReferenceDrawn:
    """A picture with the graph that made it."""

    def __init__(
        self,
        leaves: dict[str, torch.Tensor],
        twist: torch.Tensor,
        centers: torch.Tensor,
        image: torch.Tensor,
        alpha: torch.Tensor,
        visible: np.ndarray,
    ) -> None:
        self._leaves, self._twist, self._centers = leaves, twist, centers
        self._image, self._alpha = image, alpha
        self.visible = visible
        pixels = image.detach().numpy()
        self.picture = Picture(pixels[..., :3], pixels[..., 3], alpha.detach().numpy(), pixels[..., 4:])

    def backward(self, gradients: Picture) -> GaussianGradients:
        """Return the derivatives of a loss, given those by the picture. To be called once."""
        image = np.concatenate([gradients.color, gradients.depth[..., None], gradients.features], axis=-1)
        outputs = [torch.tensor(np.asarray(array, dtype=float)) for array in (image, gradients.alpha)]
        torch.autograd.backward([self._image, self._alpha], outputs)

        def of(tensor: torch.Tensor) -> np.ndarray:
            return np.zeros(tensor.shape) if tensor.grad is None else tensor.grad.numpy()

        return GaussianGradients(
            **{name: of(leaf) for name, leaf in self._leaves.items()}, centers=of(self._centers), twist=of(self._twist)
        )
