"""The pairs: a Middlebury pair, frames of an endoscope, generated rooms, rendered needles."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from benchmarks.disparity.rendered_pairs import kept, made, needle_stem, room_stems
from stages.disparity.rectification import matched_features
from stages.disparity.semi_global import gray_of
from stages.kit.formats.frames import FrameReader
from stages.suture.world.tubes import NEEDLE, THREAD

ROOM_SEEDS = (1000,)
"""Reporting seed of the recipe `room`."""
TUNING_SEEDS = (100,)
"""The sub-pixel table and the settings were looked at with this one."""
ROOM_FRAMES = 8
NEEDLE_SEEDS, TUNING_NEEDLES = range(3100, 3106), range(300, 304)
"""Scenes of the needle world."""
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


@dataclass(frozen=True)
class Pair:
    """A rectified pair and what is known of it."""

    name: str
    left: np.ndarray
    """(H, W, 3) uint8 RGB."""
    right: np.ndarray
    truth: np.ndarray
    """(H, W) disparity [px], NaN where it is not known."""
    parts: dict[str, np.ndarray] = field(default_factory=dict)
    """Name -> (H, W) bool: parts of the picture that are scored by themselves too."""


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
        every = 4 if setting.quick else 2
        for stem in room_stems(setting.work / "pairs", library, seed, ROOM_FRAMES, every=every):
            pair = kept(stem)
            yield Pair(stem.name, pair.left, pair.right, pair.disparity)


def needles(setting: Setting) -> Iterator[Pair]:
    """Scenes of the needle world before two cameras 6 cm apart: needle, thread, and all else, which is the pad and the
    drivers."""
    seeds = TUNING_NEEDLES if setting.tuning else NEEDLE_SEEDS
    for seed in seeds[:2] if setting.quick else seeds:
        stem = needle_stem(setting.work / "pairs", seed)
        pair = kept(stem)
        needle, thread = pair.bodies == NEEDLE, pair.bodies == THREAD
        parts = {"needle": needle, "thread": thread, "background": ~(needle | thread)}
        yield Pair(stem.name, pair.left, pair.right, pair.disparity, parts)


CASES: dict[str, Callable[[Setting], Iterator[Pair]]] = {
    "motorcycle": motorcycle,
    "endoscope": endoscope,
    "rooms": rooms,
    "needles": needles,
}
