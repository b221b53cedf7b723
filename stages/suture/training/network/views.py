"""Rendered pairs of the needle world, kept on disk: pictures and each pixel's body as PNG, truth by the scene's seed.

A view that is there already is not rendered again, so that a stopped run goes on.
"""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.suture.rig import StereoRig
from scenewright.stages.suture.world.render import StereoView, render
from scenewright.stages.suture.world.sampling import seen_scene

CALIBRATION_ERROR = 0.15
"""Standard deviation of the right eye's error [px], as in the needle benchmark's ordinary cases."""
EYES = ("left", "right")


def view_name(rig: StereoRig, seed: int) -> str:
    """Return the name under which the view of `seed` is kept."""
    return f"{'endoscope' if rig.baseline < 0.02 else 'cameras'}_{seed:05d}"


def kept_view(folder: Path, rig: StereoRig, seed: int) -> Path:
    """Return the stem (without `_left.png`, ...) of the view of `seed`; it is rendered if it is not there yet."""
    stem = folder / view_name(rig, seed)
    if not is_kept(stem):
        keep_view(stem, render(seen_scene(seed, rig, calibration_error=CALIBRATION_ERROR)[0]))
    return stem


def is_kept(stem: Path) -> bool:
    """Whether the view of this stem is there, whole."""
    return _file(stem, EYES[-1], "bodies").is_file()


def keep_view(stem: Path, view: StereoView) -> None:
    """Write both eyes' pictures and bodies of a view."""
    stem.parent.mkdir(parents=True, exist_ok=True)
    for eye, seen in zip(EYES, (view.left, view.right), strict=True):
        assert seen.image is not None
        _write(_file(stem, eye, "rgb"), seen.image[..., ::-1])
        _write(_file(stem, eye, "bodies"), seen.bodies)


def read_eye(stem: Path, eye: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the picture (H, W, 3) uint8 RGB and the bodies (H, W) uint8 of one eye ("left" or "right")."""
    picture = cv2.imread(str(_file(stem, eye, "rgb")), cv2.IMREAD_COLOR)
    bodies = cv2.imread(str(_file(stem, eye, "bodies")), cv2.IMREAD_GRAYSCALE)
    if picture is None or bodies is None:
        raise BadInput(f"{stem}: the kept view cannot be read", hint="delete its files; it will be rendered again")
    return np.ascontiguousarray(picture[..., ::-1]), np.asarray(bodies, dtype=np.uint8)


def _file(stem: Path, eye: str, kind: str) -> Path:
    return stem.with_name(f"{stem.name}_{eye}_{kind}.png")


def _write(path: Path, image: np.ndarray) -> None:
    """Write a PNG whole or not at all."""
    half = path.with_name("half_" + path.name)
    cv2.imwrite(str(half), image)
    os.replace(half, path)
