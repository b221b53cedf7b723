"""The pairs: a Middlebury pair, frames of an endoscope, generated rooms."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from stages.kit.formats.frames import FrameReader
from stages.kit.running.chain import run_command
from stages.kit.stereo.rectification import matched_features
from stages.kit.stereo.semi_global import gray_of

ROOM_SEEDS = (1000,)
"""Reporting seed of the recipe `room`."""
TUNING_SEEDS = (100,)
"""The sub-pixel table and the settings were looked at with this one."""
ROOM_FRAMES = 8
BASELINE, PICTURE_NOISE = 0.12, 2.0
ROWS_AGREE = 0.75
"""Matched features of the endoscope count as truth when their rows differ by no more than this [px]."""


@dataclass(frozen=True)
class Setting:
    """What is run, and where."""

    data: Path
    """Folder of the real logs."""
    work: Path
    """Folder for what the cases make."""
    quick: bool = False
    tuning: bool = False
    """Rooms of the tuning seeds instead of the reporting ones."""


def made(arguments: list[str]) -> None:
    """Run a command of ours. Raises RuntimeError when it fails."""
    code, _ = run_command([*arguments, "--quiet"])
    if code != 0:
        raise RuntimeError(f"scenewright {' '.join(arguments)} ended with {code}")


@dataclass(frozen=True)
class Pair:
    """A rectified pair and what is known of it."""

    name: str
    left: np.ndarray
    """(H, W, 3) uint8 RGB."""
    right: np.ndarray
    truth: np.ndarray
    """(H, W) disparity [px], NaN where it is not known."""


def motorcycle(setting: Setting) -> Iterator[Pair]:
    """Middlebury 2014's Motorcycle at a quarter of its size, with its measured disparities."""
    folder = setting.data / "middlebury_motorcycle"
    left, right = (cv2.imread(str(folder / f"motorcycle_{eye}.png"))[..., ::-1].copy() for eye in ("left", "right"))
    truth = np.load(folder / "motorcycle_disp.npz", allow_pickle=False)["arr_0"].astype(np.float32)
    truth[~(np.isfinite(truth) & (truth > 0))] = np.nan
    yield Pair("motorcycle", left, right, truth)


def endoscope(setting: Setting) -> Iterator[Pair]:
    """Every second in-vivo frame of a stereo endoscope.

    Nobody measured their disparities: those of SIFT features that match in both directions and lie in one row stand for
    them.
    """
    sequence = setting.work / "endoscope"
    made(["ingest", "--log", str(setting.data / "surgt_stereo"), "--out", str(sequence)])
    with FrameReader(sequence / "frames.mcap") as reader:
        for index in range(0, len(reader), 5 if setting.quick else 2):
            frame = reader.read(index, ("color", "right"))
            assert frame.color is not None and frame.right is not None
            yield Pair(f"endoscope frame {index}", frame.color, frame.right, feature_truth(frame.color, frame.right))


def feature_truth(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return disparities (H, W) float32 [px] of matched features at their pixels, NaN elsewhere; those over six
    median absolute deviations from the median are taken for mistakes."""
    first, second = matched_features(gray_of(left), gray_of(right))
    truth = np.full(left.shape[:2], np.nan, np.float32)
    disparity = first[:, 0] - second[:, 0]
    good = (np.abs(first[:, 1] - second[:, 1]) <= ROWS_AGREE) & (disparity > 0)
    middle = np.median(disparity[good])
    spread = np.median(np.abs(disparity[good] - middle))
    good &= np.abs(disparity - middle) <= 6 * spread
    place = np.rint(first[good]).astype(int)
    truth[place[:, 1].clip(0, truth.shape[0] - 1), place[:, 0].clip(0, truth.shape[1] - 1)] = disparity[good]
    return truth


def rooms(setting: Setting) -> Iterator[Pair]:
    """Generated rooms with exact depth, eyes 12 cm apart, pictures with noise of two grey levels."""
    library = setting.work / "cad_library"
    shapes = ["--shapes-per-class", "4", "--small-shapes-per-class", "4"]
    made(["library", "build", *shapes, "--seed", "1", "--out", str(library)])
    for seed in TUNING_SEEDS if setting.tuning else ROOM_SEEDS:
        truth, sequence = setting.work / f"room-{seed}", setting.work / f"room-{seed}-sequence"
        made(["synthesize", "--library", str(library), "--frames", str(ROOM_FRAMES), "--seed", str(seed),
             "--stereo-baseline", str(BASELINE), "--picture-noise", str(PICTURE_NOISE), "--no-depth-noise",
             "--out", str(truth)]
        )  # fmt: skip
        made(["ingest", "--log", str(truth / "log.mcap"), "--out", str(sequence)])
        with FrameReader(sequence / "frames.mcap") as reader:
            focal = reader.camera.fx
            for frame in reader.frames(("color", "right", "depth"), every=4 if setting.quick else 2):
                assert frame.color is not None and frame.right is not None and frame.depth is not None
                with np.errstate(divide="ignore"):
                    disparity = np.where(frame.depth > 0, focal * BASELINE / frame.depth, np.nan).astype(np.float32)
                yield Pair(f"room {seed} frame {frame.index}", frame.color, frame.right, disparity)


CASES: dict[str, Callable[[Setting], Iterator[Pair]]] = {
    "motorcycle": motorcycle,
    "endoscope": endoscope,
    "rooms": rooms,
}
