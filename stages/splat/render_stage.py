"""The step `splat render`."""

from __future__ import annotations

import numpy as np
from PIL import Image
from scenewright.schemas.errors import BadInput
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.splat import Splat, SplatViews, SplatViewsFile, ViewFigures
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.rendering.splatting.rasterizer import Picture, View
from scenewright.stages.kit.stage import Context
from scenewright.stages.splat.build_stage import rasterizer_of
from scenewright.stages.splat.losses import signal_to_noise, structural_similarity
from scenewright.stages.splat.parameters import RenderParameters
from scenewright.stages.splat.ply import read_gaussians
from scenewright.stages.splat.turntable import opened, turn, write_turn
from scenewright.stages.splat.views import PosedView, evenly, posed_frames, read_view

FULL_RED = 0.2
"""Difference of depth that is drawn in full red (behind) or blue (in front) [m]."""


def run(splat: Splat, sequence: Sequence, *, parameters: RenderParameters, context: Context) -> SplatViews:
    """Compare pictures of a splat with those of the sequence that it was built from.

    The outcome is `empty` where no view is of the kind asked for. Raises BadInput for another sequence.
    """
    info = splat.built
    uses_wanted = ("held_out", "learned") if parameters.views == "all" else (parameters.views,)
    uses = {view.frame: view.use for view in info.views if view.use in uses_wanted}
    width = max(camera.width for camera in info.cameras.values())
    gaussians, rasterizer = read_gaussians(splat.path("splat.ply")), rasterizer_of(context.device)
    drawn_frames = set(evenly(sorted(uses), parameters.pictures) if parameters.pictures else [])
    figures = []
    with FrameReader(sequence.path("frames.mcap")) as reader:
        poses = dict(posed_frames(reader, sequence, splat))
        strangers = [frame for frame in uses if frame not in poses]
        if strangers:
            raise BadInput(
                f"{sequence.root}: frame {strangers[0]} is not there: the splat was built from another sequence",
                hint="give that sequence",
            )
        for frame in context.progress.track(sorted(uses), total=len(uses), description="views"):
            view = read_view(reader, frame, poses[frame], width)
            if view is None:
                continue
            picture = rasterizer.draw(gaussians, View(view.camera, view.camera_from_world)).picture
            figures.append(figures_of(view, picture, uses[frame]))
            if frame in drawn_frames:
                (context.output / "pictures").mkdir(exist_ok=True)
                Image.fromarray(beside(view, picture)).save(context.output / "pictures" / f"{frame:06d}.png")
    if parameters.turntable and len(gaussians):
        inside = opened(gaussians, np.array([pose[:3, 3] for pose in poses.values()]))
        turned = turn(inside, rasterizer, parameters.turntable)
        write_turn(
            context.output, list(context.progress.track(turned, total=parameters.turntable, description="turntable"))
        )
    errors = [each.depth_error for each in figures if each.depth_error is not None]
    file = SplatViewsFile(
        views=tuple(figures),
        psnr=float(np.mean([each.psnr for each in figures])) if figures else 0.0,
        ssim=float(np.mean([each.ssim for each in figures])) if figures else 0.0,
        depth_error=float(np.mean(errors)) if errors else None,
    )
    file.write(context.output / "views.json")
    summary = {"views": len(figures), "psnr": round(file.psnr, 3), "ssim": round(file.ssim, 4)}
    if file.depth_error is not None:
        summary["depth_error"] = round(file.depth_error, 4)
    return SplatViews(context.output, outcome="ok" if figures else "empty", summary=summary)


def figures_of(view: PosedView, picture: Picture, use: str) -> ViewFigures:
    """Return how well a view is shown."""
    clipped = np.clip(picture.color, 0, 1)
    error = None
    if view.depth is not None and (view.depth > 0).any():
        error = float(np.median(np.abs(expected_depth(picture) - view.depth)[view.depth > 0]))
    return ViewFigures.model_validate(
        {
            "frame": view.frame,
            "use": use,
            "psnr": signal_to_noise(clipped, view.color),
            "ssim": structural_similarity(clipped, view.color)[0],
            "depth_error": error,
            "cover": float(picture.alpha.mean()),
        }
    )


def expected_depth(picture: Picture) -> np.ndarray:
    """Return the mean depth (H, W) [m] of what covers each pixel."""
    return picture.depth / np.maximum(picture.alpha, 1e-6)


def beside(view: PosedView, picture: Picture) -> np.ndarray:
    """Return (H, 3 W, 3) uint8: what the camera saw, what the splat shows, and how depths differ: red behind what was
    measured, blue in front of it, grey where nothing was measured."""
    clipped = np.clip(picture.color, 0, 1)
    difference = np.full(view.color.shape, 0.5)
    if view.depth is not None:
        has_depth = view.depth > 0
        error = np.clip((expected_depth(picture) - view.depth) / FULL_RED, -1, 1)
        painted = np.stack([1 - np.maximum(-error, 0), 1 - np.abs(error), 1 - np.maximum(error, 0)], axis=-1)
        difference[has_depth] = painted[has_depth]
    return np.round(255 * np.concatenate([view.color, clipped, difference], axis=1)).astype(np.uint8)
