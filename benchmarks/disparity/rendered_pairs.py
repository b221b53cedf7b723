"""Rendered pairs to train and to report on, kept on disk.

Rooms come from `synthesize` with exact depth, needles from the needle world. A pair that is there is not made again.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scenewright.stages.disparity.training.raft_stereo.kept_pairs import KeptPair, is_kept, keep
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.suture import TWO_CAMERAS, StereoRig, render, seen_scene

from benchmarks.steps import made

BASELINE, PICTURE_NOISE = 0.12, 2.0
"""Of the rooms: distance of the eyes [m], noise of their pictures [of 255]."""


def needle_stem(folder: Path, seed: int, rig: StereoRig = TWO_CAMERAS, calibration_error: float = 0.0) -> Path:
    """Return the stem of the pair of a scene of the needle world; it is rendered if it is not there yet."""
    stem = folder / f"{'needle' if rig is TWO_CAMERAS else 'endoscope'}_{seed:05d}"
    if not is_kept(stem):
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
    if not all(is_kept(stem) for stem in stems):
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
