"""Masks of needle, thread and what hides them, from wherever they come."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.schemas.places import data_file
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.suture_needle import MaskSource
from scenewright.schemas.suture_scene import SutureScene
from scenewright.stages.suture.needle.observation import NeedleObservation, violet
from scenewright.stages.suture.options import CHECKPOINT, MaskOptions
from scenewright.stages.suture.pairs import Pair
from scenewright.stages.suture.rig import StereoRig
from scenewright.stages.suture.truth_files import SIDES, eyes_of_truth, read_label_image
from scenewright.stages.suture.world.corruption import spoiled_drivers, spoiled_mask, spoiled_thread
from scenewright.stages.suture.world.render import Eye
from scenewright.stages.suture.world.tubes import LEFT_DRIVER, NEEDLE, RIGHT_DRIVER, THREAD

if TYPE_CHECKING:
    from scenewright.stages.suture.segmentation.infer import Masks

SEED_OF_MASKS = 5
"""First number of the seed from which masks are spoiled."""
BUNDLED = data_file(CHECKPOINT)
OTHER_MASKS = "give --masks FOLDER instead"
DRIVER_GROWTH = 5
"""Side [px] of the square by which learned masks of drivers grow: their rims hide the needle too."""
WHITE = 255
"""Needle in a mask file of black and white."""
SOURCES = {
    "network": "a learned segmenter ({0})",
    "files": "mask files ({0})",
    "truth": "the rendered truth",
    "spoiled": "the rendered truth with the structured errors of a learned mask",
}


@dataclass(frozen=True)
class EyeMasks:
    """Of the left and the right eye each (H, W) bool: `needle`, `thread`, and what may hide them (None: not known)."""

    needle: tuple[np.ndarray, np.ndarray]
    thread: tuple[np.ndarray, np.ndarray]
    hidden: tuple[np.ndarray, np.ndarray] | tuple[None, None]

    def observation(
        self, rig: StereoRig, disparity: np.ndarray | None, pictures: tuple[np.ndarray, np.ndarray] | None = None
    ) -> NeedleObservation:
        """Return what an estimator of the needle is given; `pictures` (H, W, 3) are those that the masks are of."""
        left_hidden, right_hidden = self.hidden
        return NeedleObservation(rig, *self.needle, disparity, *self.thread, left_hidden, right_hidden, pictures)


MaskMaker = Callable[[Pair], EyeMasks]


def spoiled_masks(left: Eye, right: Eye, seed: int) -> tuple[EyeMasks, np.random.Generator]:
    """Return the truth of both eyes spoiled as a learned mask is, and the generator as it was left.

    Thread is found by its violet where an eye has a picture, else it is the true one with patches lost.
    """
    random = np.random.default_rng([SEED_OF_MASKS, seed])
    needle = spoiled_mask(left, random), spoiled_mask(right, random)
    threads = []
    for eye in (left, right):
        thread = spoiled_thread(eye, random)
        threads.append(thread if eye.image is None else violet(eye.image))
    hidden = spoiled_drivers(left, random), spoiled_drivers(right, random)
    return EyeMasks(needle, (threads[0], threads[1]), hidden), random


def open_masks(
    sequence: Sequence, masks: Path | None, segmenter: Path | None, parameters: MaskOptions, size: tuple[int, int]
) -> tuple[MaskMaker, MaskSource, str]:
    """Return what makes a frame's masks, of which source, and the source in words; `size` is (rows, columns).

    Raises BadInput for a truth that is not there, MissingDependency for a network that is not.
    """
    source: Any = parameters.segmentation
    if source == "auto":
        source = "files" if masks is not None else "network"
    words = SOURCES[source].format((masks or segmenter or BUNDLED).name)
    return _MAKERS[source](sequence, masks, segmenter, size), source, words


def _from_files(sequence: Sequence, folder: Path | None, segmenter: Path | None, size: tuple[int, int]) -> MaskMaker:
    assert folder is not None  # the declaration asks for it
    return masks_in(folder, size)


def numbered(pair: Pair) -> str:
    """Return how the masks of a frame are called, by its number."""
    return f"{pair.index:06d}"


def masks_in(folder: Path, size: tuple[int, int], name_of: Callable[[Any], str] = numbered) -> MaskMaker:
    """Return what reads a frame's masks from the files of its name. Raises BadInput where there is no folder."""
    if not folder.is_dir():
        raise BadInput(
            f"{folder}: no folder of masks", hint="give a folder with 000000_left.png, 000000_right.png, ..."
        )

    def make(pair: Pair) -> EyeMasks:
        eyes = [read_label_image(folder / f"{name_of(pair)}_{side}.png", size) for side in SIDES]
        needle = tuple((eye == NEEDLE) | (eye == WHITE) for eye in eyes)
        thread = tuple(eye == THREAD for eye in eyes)
        hidden = tuple((eye == LEFT_DRIVER) | (eye == RIGHT_DRIVER) for eye in eyes)
        return EyeMasks(needle, thread, hidden)  # type: ignore[arg-type]

    return make


def _true_eyes(sequence: Sequence, size: tuple[int, int]) -> Callable[[Pair], tuple[Eye, Eye, int]]:
    """Return what gives both eyes' truth of a pair, and its view's seed. Raises BadInput where there is no truth."""
    if not isinstance(sequence, SutureScene):
        raise BadInput(
            f"{sequence.root}: no masks: a {sequence.kind!r} has no truth to take them from",
            hint="leave --segmentation out: the shipped network finds them, or your --masks FOLDER",
        )
    views, folder = sequence.truth.views, sequence.path("truth")

    def eyes(pair: Pair) -> tuple[Eye, Eye, int]:
        if pair.index >= len(views):
            raise BadInput(f"{sequence.root}: frame {pair.index} has no truth", hint="make the scene again")
        return *eyes_of_truth(folder, pair.index, size), views[pair.index].seed

    return eyes


def _from_spoiled(sequence: Sequence, masks: Path | None, segmenter: Path | None, size: tuple[int, int]) -> MaskMaker:
    true_eyes = _true_eyes(sequence, size)

    def make(pair: Pair) -> EyeMasks:
        left, right, seed = true_eyes(pair)
        left_eye = Eye(pair.left, left.bodies, left.depth, left.sees)
        right_eye = Eye(pair.right, right.bodies, right.depth, right.sees)
        return spoiled_masks(left_eye, right_eye, seed)[0]

    return make


def _from_truth(sequence: Sequence, masks: Path | None, segmenter: Path | None, size: tuple[int, int]) -> MaskMaker:
    true_eyes = _true_eyes(sequence, size)

    def make(pair: Pair) -> EyeMasks:
        left, right, _ = true_eyes(pair)
        return EyeMasks(
            (left.mask(NEEDLE), right.mask(NEEDLE)),
            (left.mask(THREAD), right.mask(THREAD)),
            (left.mask(LEFT_DRIVER, RIGHT_DRIVER), right.mask(LEFT_DRIVER, RIGHT_DRIVER)),
        )

    return make


def _from_network(sequence: Sequence, masks: Path | None, checkpoint: Path | None, size: tuple[int, int]) -> MaskMaker:
    return network_masks(checkpoint)


def network_masks(checkpoint: Path | None) -> MaskMaker:
    """Return what makes a frame's masks by the segmenter of a checkpoint, or by the one in data/."""
    segmenter = open_segmenter(checkpoint)

    def make(pair: Pair) -> EyeMasks:
        return learned_masks(segmenter.masks(pair.left), segmenter.masks(pair.right))

    return make


_MAKERS: dict[MaskSource, Callable[[Sequence, Path | None, Path | None, tuple[int, int]], MaskMaker]] = {
    "files": _from_files,
    "network": _from_network,
    "truth": _from_truth,
    "spoiled": _from_spoiled,
}


def learned_masks(left: Masks, right: Masks) -> EyeMasks:
    """Return what the segmenter found in both eyes; drivers, grown a little, may hide the needle."""
    square = np.ones((DRIVER_GROWTH, DRIVER_GROWTH), np.uint8)
    hidden = tuple(cv2.dilate(eye.driver.astype(np.uint8), square) > 0 for eye in (left, right))
    return EyeMasks((left.needle, right.needle), (left.thread, right.thread), hidden)  # type: ignore[arg-type]


def open_segmenter(checkpoint: Path | None, instead: str = OTHER_MASKS) -> Any:
    """Return the segmenter of a checkpoint, or of the one in data/. Raises MissingDependency without one, saying what
    does `instead`."""
    try:
        infer = importlib.import_module("scenewright.stages.suture.segmentation.infer")
    except ImportError as error:
        raise MissingDependency(f"the learned segmenter cannot be loaded: {error}", hint=instead) from None
    path = checkpoint if checkpoint is not None else BUNDLED
    if not path.is_file():
        raise MissingDependency(f"{path}: there is no checkpoint of the segmenter", hint=instead)
    return infer.Segmenter.load(path)
