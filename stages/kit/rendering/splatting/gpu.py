"""The rasteriser of gsplat (github.com/nerfstudio-project/gsplat, Apache-2.0), where CUDA is."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from scenewright.schemas.errors import MissingDependency
from scenewright.stages.kit.rendering.splatting import rasterizer
from scenewright.stages.kit.rendering.splatting.compiled import CompiledRasterizer
from scenewright.stages.kit.rendering.splatting.gaussians import GaussianGradients, Gaussians
from scenewright.stages.kit.rendering.splatting.harmonics import view_basis
from scenewright.stages.kit.rendering.splatting.rasterizer import Drawn, Picture, View
from scenewright.stages.kit.rendering.splatting.reference import moved


class GpuRasterizer:
    """Draws with gsplat. Raises MissingDependency without CUDA or without gsplat."""

    def __init__(self) -> None:
        if not torch.cuda.is_available():
            raise MissingDependency(
                "gsplat draws with CUDA and there is no CUDA device", hint="leave out --device cuda"
            )
        try:
            import gsplat
        except ImportError as error:
            raise MissingDependency(f"gsplat cannot be loaded ({error})", hint="pip install gsplat") from None
        self._draw = gsplat.rasterization

    def draw(self, gaussians: Gaussians, view: View) -> Drawn:
        """Return what the view shows. Raises ValueError for a picture without pixels."""
        if not len(gaussians):
            return CompiledRasterizer().draw(gaussians, view)  # gsplat ends the process where there are none
        leaves = {
            name: torch.tensor(array, dtype=torch.float32, device="cuda", requires_grad=True)
            for name, array in gaussians.arrays().items()
        }
        twist = torch.zeros(6, device="cuda", requires_grad=True)
        camera = view.camera
        basis = view_basis(gaussians.means, view.camera_from_world, gaussians.harmonics.shape[1])
        harmonic_basis = torch.tensor(basis, dtype=torch.float32, device="cuda")
        colors = torch.clamp(torch.einsum("nk,nkc->nc", harmonic_basis, leaves["harmonics"]) + 0.5, min=0.0)
        values = torch.cat([colors, leaves["features"]], dim=1)
        matrix = [[camera.fx, 0.0, camera.cx + 0.5], [0.0, camera.fy, camera.cy + 0.5], [0.0, 0.0, 1.0]]
        background = torch.zeros(1, values.shape[1], device="cuda")
        background[0, :3] = torch.tensor(view.background)
        image, alpha, details = self._draw(
            leaves["means"],
            leaves["quaternions"],
            torch.exp(leaves["log_scales"]),
            torch.sigmoid(leaves["logit_opacities"]),
            values,
            moved(view.camera_from_world, twist)[None],
            torch.tensor([matrix], device="cuda"),
            camera.width,
            camera.height,
            near_plane=rasterizer.NEAR,
            eps2d=rasterizer.DILATION,
            packed=False,
            backgrounds=background,
            render_mode="RGB+D",
        )
        details["means2d"].retain_grad()
        return GpuDrawn(leaves, twist, image[0], alpha[0, ..., 0], details)


class GpuDrawn:
    """A picture with the graph that made it."""

    def __init__(
        self, leaves: dict[str, torch.Tensor], twist: torch.Tensor, image: torch.Tensor, alpha: torch.Tensor, told: Any
    ) -> None:
        self._leaves, self._twist, self._image, self._alpha, self._details = leaves, twist, image, alpha, told
        pixels = image.detach().cpu().numpy()
        self.visible = (told["radii"][0] > 0).reshape(len(leaves["means"]), -1).all(dim=1).cpu().numpy()
        self.picture = Picture(pixels[..., :3], pixels[..., -1], alpha.detach().cpu().numpy(), pixels[..., 3:-1])

    def backward(self, gradients: Picture) -> GaussianGradients:
        """Return the derivatives of a loss, given those by the picture. To be called once."""
        image = np.concatenate([gradients.color, gradients.features, gradients.depth[..., None]], axis=-1)
        outputs = [torch.tensor(np.asarray(a, np.float32), device="cuda") for a in (image, gradients.alpha)]
        torch.autograd.backward([self._image, self._alpha], outputs)

        def of(tensor: torch.Tensor) -> np.ndarray:
            grad = torch.zeros_like(tensor) if tensor.grad is None else tensor.grad
            return grad.cpu().numpy()

        return GaussianGradients(
            **{name: of(leaf) for name, leaf in self._leaves.items()},
            centers=of(self._details["means2d"])[0],
            twist=of(self._twist),
        )
