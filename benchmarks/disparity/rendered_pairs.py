"""Rendered pairs to train and to report on, kept on disk: both eyes as PNG, the left disparity in 64ths of a pixel.

Rooms come from `synthesize` with exact depth, needles from the needle world. A pair that is there is not made again.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.suture.rig import TWO_CAMERAS, StereoRig
from scenewright.stages.suture.world.render import render
from scenewright.stages.suture.world.sampling import seen_scene

from benchmarks.steps import made

FRACTION = 64.0
"""Disparities are kept in so many parts of a pixel, as 16-bit numbers; 0 is unknown."""
BASELINE, PICTURE_NOISE = 0.12, 2.0
"""Of the rooms: distance of the eyes [m], noise of their pictures [of 255]."""


@dataclass(frozen=True)
class KeptPair:
    """A pair with its truth."""

    left: np.ndarray
    """(H, W, 3) uint8 RGB."""
    right: np.ndarray
    disparity: np.ndarray
    """(H, W) float32 [px], NaN unknown."""
    bodies: np.ndarray
    """(H, W) uint8: the needle world's bodies; zero in rooms."""


def needle_stem(folder: Path, seed: int, rig: StereoRig = TWO_CAMERAS, calibration_error: float = 0.0) -> Path:
    """Return the stem of the pair of a scene of the needle world; it is rendered if it is not there yet."""
    stem = folder / f"{'needle' if rig is TWO_CAMERAS else 'endoscope'}_{seed:05d}"
    if not _file(stem, "left").is_file():
        view = render(seen_scene(seed, rig, calibration_error=calibration_error)[0])
        assert view.left.image is not None and view.right.image is not None
        keep(stem, KeptPair(view.left.image, view.right.image, view.disparity, view.left.bodies))
    return stem


def room_stems(
    folder: Path, library: Path, seed: int, frames: int, size: tuple[int, int] = (640, 480), every: int = 1
) -> list[Path]:
    """Return the stems of the pairs of a generated room of this seed (width, height [px]); every n-th frame of
    `frames` is kept."""
    stems = [folder / f"room_{seed:05d}_{frame:03d}_of_{frames:03d}" for frame in range(0, frames, every)]
    if not all(_file(stem, "left").is_file() for stem in stems):
        work = folder / f"room_{seed:05d}_{frames:03d}"
        for stem, pair in zip(stems, _room_pairs(work, library, seed, frames, size, every), strict=True):
            keep(stem, pair)
    return stems


def _room_pairs(
    work: Path, library: Path, seed: int, frames: int, size: tuple[int, int], every: int
) -> Iterator[KeptPair]:
    made(
        "synthesize",
        work / "truth",
        "--library",
        library,
        "--frames",
        frames,
        "--seed",
        seed,
        "--no-depth-noise",
        "--width",
        size[0],
        "--height",
        size[1],
        "--stereo-baseline",
        BASELINE,
        "--picture-noise",
        PICTURE_NOISE,
    )
    made("ingest", work / "sequence", "--log", work / "truth" / "log.mcap")
    with FrameReader(work / "sequence" / "frames.mcap") as reader:
        for frame in reader.frames(("color", "right", "depth"), every=every):
            assert frame.color is not None and frame.right is not None and frame.depth is not None
            with np.errstate(divide="ignore"):
                disparity = np.where(frame.depth > 0, reader.camera.fx * BASELINE / frame.depth, np.nan)
            bodies = np.zeros(disparity.shape, np.uint8)
            yield KeptPair(frame.color, frame.right, disparity.astype(np.float32), bodies)


def keep(stem: Path, pair: KeptPair) -> None:
    """Write a pair; the left picture last, as it is looked for."""
    stem.parent.mkdir(parents=True, exist_ok=True)
    disparity = pair.disparity
    fixed = np.where(np.isfinite(disparity) & (disparity > 0), np.rint(FRACTION * np.nan_to_num(disparity)), 0)
    _write(_file(stem, "disparity"), np.clip(fixed, 0, 65535).astype(np.uint16))
    _write(_file(stem, "bodies"), pair.bodies)
    _write(_file(stem, "right"), pair.right[..., ::-1])
    _write(_file(stem, "left"), pair.left[..., ::-1])


def kept(stem: Path) -> KeptPair:
    """Read a pair. Raises BadInput for a damaged one."""
    left, right = (cv2.imread(str(_file(stem, eye)), cv2.IMREAD_COLOR) for eye in ("left", "right"))
    fixed, bodies = (cv2.imread(str(_file(stem, what)), cv2.IMREAD_UNCHANGED) for what in ("disparity", "bodies"))
    if left is None or right is None or fixed is None or bodies is None:
        raise BadInput(f"{stem}: the kept pair cannot be read", hint="delete its files; it will be made again")
    disparity = np.where(fixed > 0, fixed / np.float32(FRACTION), np.nan).astype(np.float32)
    return KeptPair(left[..., ::-1].copy(), right[..., ::-1].copy(), disparity, bodies)


def _file(stem: Path, what: str) -> Path:
    return stem.with_name(f"{stem.name}_{what}.png")


def _write(path: Path, picture: np.ndarray) -> None:
    half = path.with_name("half_" + path.name)
    cv2.imwrite(str(half), picture)
    os.replace(half, path)
