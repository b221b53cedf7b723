"""The pairs: a Middlebury pair, frames of an endoscope, generated rooms, rendered needles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from scenewright.stages.disparity import gray_of, matched_features
from scenewright.stages.disparity.training.raft_stereo.kept_pairs import kept
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.suture import NEEDLE, THREAD

from benchmarks.disparity.rendered_pairs import needle_stem, room_stems
from benchmarks.steps import made

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


@dataclass(frozen=True)
class Case:
    """Which pairs there are, and how one is had. Both take the folder of the real logs and one for what is made."""

    names: Callable[[Path, Path, bool, bool], list[str]]
    """(data, work, quick, tuning) -> names; none where the data are not there."""
    pair: Callable[[Path, Path, str], Pair]


def motorcycle(data: Path, work: Path, name: str) -> Pair:
    """Middlebury 2014's Motorcycle at a quarter of its size, with its measured disparities."""
    folder = data / "middlebury_motorcycle"
    eyes = [cv2.imread(str(folder / f"motorcycle_{eye}.png")) for eye in ("left", "right")]
    left, right = (np.asarray(eye)[..., ::-1].copy() for eye in eyes)
    truth = np.load(folder / "motorcycle_disp.npz", allow_pickle=False)["arr_0"].astype(np.float32)
    truth[~(np.isfinite(truth) & (truth > 0))] = np.nan
    return Pair(name, left, right, truth)


def motorcycle_names(data: Path, work: Path, quick: bool, tuning: bool) -> list[str]:
    """The pair."""
    return ["motorcycle"] if (data / "middlebury_motorcycle").is_dir() else []


def endoscope(data: Path, work: Path, name: str) -> Pair:
    """A frame of a stereo endoscope, in vivo.

    Nobody measured their disparities: those of SIFT features that match in both directions and lie in one row stand for
    them.
    """
    with FrameReader(_endoscope_sequence(data, work) / "frames.mcap") as reader:
        frame = reader.read(int(name), ("color", "right"))
    assert frame.color is not None and frame.right is not None
    return Pair(name, frame.color, frame.right, feature_truth(frame.color, frame.right))


def endoscope_names(data: Path, work: Path, quick: bool, tuning: bool) -> list[str]:
    """Every second frame."""
    if not (data / "surgt_stereo").is_dir():
        return []
    with FrameReader(_endoscope_sequence(data, work) / "frames.mcap") as reader:
        return [str(index) for index in range(0, len(reader), 5 if quick else 2)]


@cache
def _endoscope_sequence(data: Path, work: Path) -> Path:
    return made("ingest", work / "endoscope", "--log", data / "surgt_stereo")


def feature_truth(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return disparities (H, W) float32 [px] of matched features at their pixels, NaN elsewhere; those over six
    median absolute deviations from the median are taken for mistakes."""
    first, second = matched_features(gray_of(left), gray_of(right))
    truth: np.ndarray = np.full(left.shape[:2], np.nan, np.float32)
    disparity = first[:, 0] - second[:, 0]
    good = (np.abs(first[:, 1] - second[:, 1]) <= ROWS_AGREE) & (disparity > 0)
    middle = np.median(disparity[good])
    spread = np.median(np.abs(disparity[good] - middle))
    good &= np.abs(disparity - middle) <= 6 * spread
    place = np.rint(first[good]).astype(int)
    truth[place[:, 1].clip(0, truth.shape[0] - 1), place[:, 0].clip(0, truth.shape[1] - 1)] = disparity[good]
    return truth


def rooms(data: Path, work: Path, name: str) -> Pair:
    """A frame of a generated room with exact depth, eyes 12 cm apart, pictures with noise of two grey levels.

    `name`: room_<seed>_<frame>_every_<n>."""
    _, seed, frame, _, every = name.split("_")
    shapes = ("--shapes-per-class", "4", "--small-shapes-per-class", "4")
    library = made("library build", work / "cad_library", *shapes, "--seed", 1)
    stems = room_stems(work / "pairs", library, int(seed), ROOM_FRAMES, every=int(every))
    pair = kept(stems[int(frame) // int(every)])
    return Pair(name, pair.left, pair.right, pair.disparity)


def room_names(data: Path, work: Path, quick: bool, tuning: bool) -> list[str]:
    """Every second frame of the rooms."""
    every = 4 if quick else 2
    seeds = TUNING_SEEDS if tuning else ROOM_SEEDS
    return [f"room_{seed}_{frame}_every_{every}" for seed in seeds for frame in range(0, ROOM_FRAMES, every)]


def needles(data: Path, work: Path, name: str) -> Pair:
    """A scene of the needle world before two cameras 6 cm apart: needle, thread, and all else, which is the pad and the
    drivers."""
    pair = kept(needle_stem(work / "pairs", int(name)))
    needle, thread = pair.bodies == NEEDLE, pair.bodies == THREAD
    parts = {"needle": needle, "thread": thread, "background": ~(needle | thread)}
    return Pair(name, pair.left, pair.right, pair.disparity, parts)


def needle_names(data: Path, work: Path, quick: bool, tuning: bool) -> list[str]:
    """Seeds of the needle world."""
    return [str(seed) for seed in (TUNING_NEEDLES if tuning else NEEDLE_SEEDS)[: 2 if quick else None]]


CASES = {
    "motorcycle": Case(motorcycle_names, motorcycle),
    "endoscope": Case(endoscope_names, endoscope),
    "rooms": Case(room_names, rooms),
    "needles": Case(needle_names, needles),
}
