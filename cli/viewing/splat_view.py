"""Splats: the Gaussians as they were found along the way, and pictures of them beside the camera's, with figures."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.outside import LARGEST_SHOWN, file_content
from scenewright.schemas.splat import Splat, SplatViews
from scenewright.stages.kit.formats.trajectories import read_tum
from scenewright.stages.kit.geometry.cameras import scaled
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.rendering.splatting.compiled import CompiledRasterizer
from scenewright.stages.kit.rendering.splatting.gaussians import Gaussians
from scenewright.stages.kit.rendering.splatting.harmonics import LEVEL_0
from scenewright.stages.kit.rendering.splatting.rasterizer import View
from scenewright.stages.kit.viewing.canvas import Canvas
from scenewright.stages.splat.ply import read_gaussians
from scenewright.stages.splat.views import evenly

FAINT = 0.15
"""Opacity below which a Gaussian is not drawn."""
MOMENTS = 24
"""Pictures that say when a Gaussian was first seen, evenly spread over those learned."""
LOOKED_WITH = 96
"""Width of the pictures in which it is looked for when a Gaussian was first seen [px]."""
BEHIND = (0.1, 0.05)
"""A Gaussian is seen unless it lies farther behind what is shown than this [m], and this share of it."""
RADII = (0.004, 0.03)
"""Smallest and largest radius of a drawn Gaussian [m]; by eye."""


def draw_splat(splat: Splat, canvas: Canvas) -> None:
    """Draw every Gaussian that is not faint as a point of its colour, from the moment on when a learned picture first
    shows it, and the camera on its way."""
    gaussians = read_gaussians(splat.path("splat.ply"))
    gaussians = gaussians.taken(1.0 / (1.0 + np.exp(-gaussians.logit_opacities)) > FAINT)
    times, poses = read_tum(splat.path("trajectory.tum"))
    learned = evenly([k for k, view in enumerate(splat.built.views) if view.use == "learned"], MOMENTS)
    cameras = [splat.built.cameras[splat.built.views[k].camera] for k in learned]
    views = [
        View(scaled(camera, min(1.0, LOOKED_WITH / camera.width)), inverse(poses[k]))
        for k, camera in zip(learned, cameras, strict=True)
    ]
    first = first_seen(gaussians, views)
    colors = np.clip(gaussians.harmonics[:, 0] * LEVEL_0 + 0.5, 0, 1)
    sizes = np.exp(gaussians.log_scales).max(axis=1)
    canvas.document("splat", f"{splat.built.gaussians} Gaussians, {len(splat.built.views)} images")
    for number, k in enumerate(learned):
        canvas.time(float(times[k]) - float(times[learned[0]]))
        canvas.transform("camera", poses[k])
        of_view = first == number
        if of_view.any():
            radius = float(np.clip(np.median(sizes[of_view]), *RADII))
            canvas.points(
                f"gaussians/{number:02d}",
                gaussians.means[of_view],
                np.round(255 * colors[of_view]).astype(np.uint8),
                radius,
            )
    canvas.always()
    if cameras:
        canvas.camera("camera", cameras[0])


def first_seen(gaussians: Gaussians, views: list[View]) -> np.ndarray:
    """Return (N,) the first of the views that shows a Gaussian; 0 where none does."""
    first = np.full(len(gaussians), -1)
    for number, view in enumerate(views):
        picture = CompiledRasterizer().draw(gaussians, view).picture
        drawn_depth = np.where(picture.alpha > 0.5, picture.depth / np.maximum(picture.alpha, 1e-6), np.inf)
        local = apply(view.camera_from_world, gaussians.means.astype(float))
        z = np.maximum(local[:, 2], 1e-6)
        columns = np.rint(view.camera.fx * local[:, 0] / z + view.camera.cx)
        rows = np.rint(view.camera.fy * local[:, 1] / z + view.camera.cy)
        inside = (local[:, 2] > 0) & (columns >= 0) & (columns < view.camera.width)
        inside &= (rows >= 0) & (rows < view.camera.height) & (first < 0)
        at = np.flatnonzero(inside)
        depth_there = drawn_depth[rows[at].astype(int), columns[at].astype(int)]
        first[at[z[at] < depth_there * (1 + BEHIND[1]) + BEHIND[0]]] = number
    return np.maximum(first, 0)


def draw_splat_views(views: SplatViews, canvas: Canvas) -> None:
    """Show every compared picture, and the figures of all as they stand in views.json."""
    canvas.document("views", f"```\n{views.info.model_dump_json(indent=1)}\n```")
    for picture in sorted(views.path("pictures").glob("*.png")):
        canvas.picture(f"pictures/{picture.stem}", file_content(picture, LARGEST_SHOWN))
