"""The rasteriser for processors: single precision, tiles, compiled (numba)."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.rendering.splatting.blending import TILE, blend, blend_back, gathered, list_tiles
from scenewright.stages.kit.rendering.splatting.gaussians import GaussianGradients, Gaussians
from scenewright.stages.kit.rendering.splatting.harmonics import view_basis
from scenewright.stages.kit.rendering.splatting.projection import project, project_back
from scenewright.stages.kit.rendering.splatting.rasterizer import Picture, View, direction_limits


class CompiledRasterizer:
    """Draws on the processor. The same bytes for any number of threads."""

    def draw(self, gaussians: Gaussians, view: View) -> CompiledDrawn:
        """Return what the view shows."""
        return CompiledDrawn(gaussians, view)


class CompiledDrawn:
    """A picture with the lists that made it."""

    def __init__(self, gaussians: Gaussians, view: View) -> None:
        camera = view.camera
        if camera.width < 1 or camera.height < 1:
            raise ValueError(f"a picture of {camera.width}x{camera.height} pixels")
        single = {name: np.ascontiguousarray(array, np.float32) for name, array in gaussians.arrays().items()}
        self._gaussians = g = Gaussians(**single)
        self._pose = np.asarray(view.camera_from_world, dtype=np.float64)
        self._focal, self._limits = np.array([camera.fx, camera.fy]), np.array(direction_limits(camera))
        center, size = np.array([camera.cx, camera.cy]), np.array([camera.width, camera.height])
        self._flat, depths, self._reach = project(
            *(g.means, g.quaternions, g.log_scales, g.logit_opacities, self._pose),
            *(self._focal, center, self._limits, size),
        )
        # powers at which alpha has fallen below what counts: looked at before the exponential
        self._flat[:, 6] = np.log(np.maximum(self._flat[:, 5], 1e-9) * 255.0) + 1e-4
        self._basis = view_basis(g.means, self._pose, g.harmonics.shape[1]).astype(np.float32)
        colors = np.einsum("nk,nkc->nc", self._basis, g.harmonics) + 0.5
        self._lit = colors > 0
        self._values = np.empty((len(g), 4 + g.features.shape[1]), np.float32)
        self._values[:, :3], self._values[:, 3], self._values[:, 4:] = np.maximum(colors, 0), depths, g.features
        self._background = np.zeros(self._values.shape[1], np.float32)
        self._background[:3] = view.background
        self.visible = (self._reach[:, 0] <= self._reach[:, 1]) & (self._reach[:, 2] <= self._reach[:, 3])
        order = np.argsort(depths, kind="stable")
        columns, rows = -(-camera.width // TILE), -(-camera.height // TILE)
        self._starts, self._members = list_tiles(order, self._reach, columns, rows)
        image, self._transmittance, self._looked = blend(
            *(self._starts, self._members, self._flat, self._reach, self._values, self._background),
            *(camera.width, camera.height),
        )
        self.picture = Picture(image[..., :3], image[..., 3], 1.0 - self._transmittance, image[..., 4:])

    def backward(self, gradients: Picture) -> GaussianGradients:
        """Return the derivatives of a loss by the Gaussians and the camera, given those by the picture."""
        g = self._gaussians
        channels = (gradients.color, gradients.depth[..., None], gradients.features)
        image_gradients = np.concatenate(channels, axis=-1).astype(np.float32, copy=False)
        behind = self._transmittance * (image_gradients @ self._background - gradients.alpha).astype(np.float32)
        by_entry = blend_back(
            *(self._starts, self._members, self._flat, self._reach, self._values),
            *(self._transmittance.copy(), self._looked, image_gradients, behind),
        )
        sums = gathered(self._members, by_entry, len(g))
        by_mean, by_quaternion, by_scale, by_logit, twist = project_back(
            *(g.means, g.quaternions, g.log_scales, self._flat, self._pose, self._focal, self._limits),
            *(sums[:, :6], np.ascontiguousarray(sums[:, 9]), self.visible),
        )
        by_color = np.where(self._lit, sums[:, 6:9], 0.0).astype(np.float32)
        return GaussianGradients(
            means=by_mean,
            quaternions=by_quaternion,
            log_scales=by_scale,
            logit_opacities=by_logit,
            harmonics=self._basis[:, :, None] * by_color[:, None, :],
            features=sums[:, 10:],
            centers=sums[:, :2],
            twist=twist,
        )
