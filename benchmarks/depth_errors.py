"""What is wrong with the depth of real logs beyond white noise: bias, bending, and colour that is beside it.

python -m benchmarks.depth_errors --runs FOLDER_OF_MAKE_REAL --out FOLDER

Bias: surface that two frames see from distances that differ by half a metre and more; by how much the depth of one,
carried over by the poses, differs from the other's, a metre of that difference. (Poses of these logs were made of the
same depth, so that part of the bias is in them: this is a lower bound.) Bending: of large flat segments in
single frames, what a paraboloid around the middle of the picture explains of 1/z beside a plane, at the corner of
the picture. Registration: the shift of the picture that puts its edges best onto edges of depth.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from pydantic import Field
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.stages.kit.formats.frames import Frame, FrameReader
from scenewright.stages.kit.geometry.cameras import back_project, project
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.segment.geometric import segment_depth
from scenewright.stages.segment.parameters import SegmentParameters
from scenewright.stages.segment.settings import geometric_settings

from benchmarks.options import Recipe, asked
from benchmarks.results import write_figures
from benchmarks.steps import opened
from benchmarks.tabulation import Figure

STRIDE = 4
FAR_APART, SAME_SURFACE = 0.5, 0.1
"""Two frames see a surface from distances that differ by the first [m]; more than the second is another surface [m]."""
LARGEST_SHIFT = 8
"""[pixels]"""


ABOUT = {
    "title": "Bias, bending and registration of real depth",
    "simulated": "Nothing, but the living room's depth and images are rendered, with a noise model.",
    "knows": "The logs' poses, which were made of the same depth.",
    "does_not_show": "What a calibrated reference would show: poses were made of the same depth, so that a bias which "
    "both have is not seen. A few frames a log.",
}


class DepthErrorOptions(Recipe):
    """Options of the measurement."""

    runs: Path = Field(description="Folder that `make real` wrote (its sequences)")
    frames: int = Field(10, ge=3, description="Frames of every log, evenly spread")


def main() -> None:
    """Measure; write depth_errors.json, in the form of docs/results."""
    options = asked(DepthErrorOptions)
    made: dict[str, Any] = {}
    for folder in sorted(options.runs.glob("*/sequence")):
        sequence = opened(SequenceArtifact, folder)
        with FrameReader(sequence.path("frames.mcap")) as reader:
            frames = list(reader.frames(every=max(1, len(reader) // options.frames)))
            camera = sequence.info.camera
        frames = [frame for frame in frames if frame.depth is not None and frame.world_from_camera is not None]
        shifts = [shift for frame in frames if (shift := registration(frame)) is not None]
        bends = [bend for frame in frames for bend in bending(frame, camera)]
        made[folder.parent.name] = {
            "frames": len(frames),
            "bias_per_metre": bias(frames, camera),
            "bending_per_square_metre": float(np.median(np.abs(bends))) if bends else None,
            "segments": len(bends),
            "registration_pixels": [float(v) for v in np.median(np.array(shifts), axis=0)] if shifts else None,
        }
    print(json.dumps(made, indent=1))
    write_figures(options.out, "depth_errors", ABOUT, figures_of(made))


def figures_of(measured: Mapping[str, Mapping[str, Any]]) -> dict[str, Figure]:
    """Return what was measured of each log as figures; what could not be is left out."""
    figures = {}
    for log, own in measured.items():
        u, v = own["registration_pixels"] or (None, None)
        bias = None if own["bias_per_metre"] is None else 100 * own["bias_per_metre"]
        told = {"bias": (bias, "%"), "bending": (own["bending_per_square_metre"], "1/m")}
        for name, (value, unit) in {**told, "beside_u": (u, "pixels"), "beside_v": (v, "pixels")}.items():
            if value is not None:
                figures[f"depth/{log}/{name}"] = Figure(round(value, 5), None, None, own["frames"], unit)
    return figures


def bias(frames: Sequence[Frame], camera: Camera) -> float | None:
    """Return by how much depth that was carried from one frame to another is off, a metre of difference in distance."""
    ratios = []
    for first in frames:
        for second in frames:
            if first is second:
                continue
            assert first.depth is not None and second.depth is not None
            assert first.world_from_camera is not None and second.world_from_camera is not None
            valid = (first.depth > 0)[::STRIDE, ::STRIDE]
            points = back_project(first.depth, camera, stride=STRIDE)[valid]
            moved = apply(inverse(second.world_from_camera) @ first.world_from_camera, points)
            pixels, z = project(moved, camera)
            inside = np.isfinite(pixels).all(axis=1)
            inside[inside] &= (pixels[inside] >= 0).all(axis=1) & (
                pixels[inside] < [camera.width - 1, camera.height - 1]
            ).all(axis=1)
            u, v = np.rint(pixels[inside]).astype(int).T
            there, carried, before = second.depth[v, u], z[inside], points[inside][:, 2]
            away = before - there
            use = (there > 0) & (np.abs(away) >= FAR_APART) & (np.abs(carried - there) < SAME_SURFACE)
            ratios += ((carried - there)[use] / away[use]).tolist()
    return float(np.median(ratios)) if len(ratios) > 100 else None


def bending(frame: Frame, camera: Camera) -> list[float]:
    """Return for each large flat segment how far a paraboloid bends it at the corner of the picture, over z^2 [1/m]."""
    assert frame.depth is not None
    geometric = segment_depth(frame.depth, camera, geometric_settings(SegmentParameters.model_validate({})))
    found = []
    v, u = np.mgrid[0 : camera.height, 0 : camera.width]
    radius = np.hypot(u - camera.cx, v - camera.cy) / np.hypot(camera.cx, camera.cy)
    labels, counts = np.unique(geometric.labels, return_counts=True)
    for label, count in zip(labels, counts, strict=True):
        own = (geometric.labels == label) & (frame.depth > 0)
        if label == 0 or count < 0.1 * own.size or np.ptp(radius[own]) < 0.5:
            continue
        z = frame.depth[own].astype(float)
        # 1/z of a plane is linear in the pixels; what a paraboloid adds to z, over z^2, is -its part of 1/z.
        columns = np.stack([u[own], v[own], np.ones(own.sum()), radius[own] ** 2], axis=1)
        solved, *_ = np.linalg.lstsq(columns, 1.0 / z, rcond=None)
        rest = np.abs(1.0 / z - columns @ solved)
        if np.median(rest * z**2) < 0.02:
            found.append(float(-solved[3]))
    return found


def registration(frame: Frame) -> np.ndarray | None:
    """Return the shift (2,) [pixels] of the colour picture that puts most of its edges onto those of depth."""
    if frame.color is None or frame.depth is None or frame.color.shape[:2] != frame.depth.shape:
        return None
    known = frame.depth > 0
    jump = cv2.morphologyEx(frame.depth, cv2.MORPH_GRADIENT, np.ones((3, 3))) > 0.1
    edges = jump & (cv2.erode(known.astype(np.uint8), np.ones((3, 3))) > 0)
    if edges.sum() < 500:
        return None
    grey = cv2.GaussianBlur(cv2.cvtColor(frame.color, cv2.COLOR_RGB2GRAY).astype(np.float32), (0, 0), 1.0)
    slope = np.hypot(cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1))
    reach = range(-LARGEST_SHIFT, LARGEST_SHIFT + 1)
    sums = {(dx, dy): float(np.roll(slope, (dy, dx), (0, 1))[edges].mean()) for dx in reach for dy in reach}
    return np.array(max(sums, key=lambda shift: sums[shift]), float)


if __name__ == "__main__":
    main()
