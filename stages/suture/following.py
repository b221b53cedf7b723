"""A needle followed while pictures arrive: pairs of a folder that grows, or of a pipe that names them, to poses.

In a folder a pair is `<name>_left.png` and `<name>_right.png` (.jpg, .bmp), in the order of their names; it is taken
when neither file has changed from one look to the next. A pipe names two files a line. Where masks are given, pictures
are not decoded: their sizes are all that is asked of them.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TextIO

import cv2
import numpy as np
from pydantic import ValidationError
from scenewright.schemas.errors import BadInput, first_problem
from scenewright.schemas.outside import file_content, file_json
from scenewright.schemas.suture_scene import RigFile
from scenewright.stages.kit.formats.image_headers import image_size
from scenewright.stages.suture.masks import EyeMasks, MaskMaker
from scenewright.stages.suture.needle.estimate import estimate
from scenewright.stages.suture.needle.observation import NeedleEstimate, NeedleObservation
from scenewright.stages.suture.needle.radius import as_if_usual, in_metres
from scenewright.stages.suture.needle.records import as_estimate_record
from scenewright.stages.suture.needle.starts import FARTHEST, NEAREST
from scenewright.stages.suture.pairs import SQUARE, Pair
from scenewright.stages.suture.rig import NEEDLE_RADIUS, NeedlePose, StereoRig

LARGEST_PICTURE = 64 * 2**20
"""Largest file that is read [bytes]; by eye."""
RIG_HINT = (
    'a rig is {"camera": {"width", "height", "fx", "fy", "cx", "cy"}, "baseline": metres}; docs/STITCH.md shows one'
)
ENDINGS = (".png", ".jpg", ".bmp")
AROUND, RIM = NEEDLE_RADIUS / 2, 48
"""How far from where it was a needle is looked for [m] (one that seems farther is looked at whole: few starts may end
in another outline of the same masks), and how far a window reaches beyond that [px], so that what lies at its edge is
judged with what is around it."""
ARC = np.linspace(0.0, np.pi, 33)
"""Angles [rad] along the needle at which its window is measured."""
UNKNOWN = {"camera_from_needle": None, "covariance": None, "tip_probability": 0.5}
"""What the line of a pair says where no pose is answered."""


@dataclass(frozen=True)
class PairFiles:
    """The two pictures of a moment, and how many older ones were passed over for it."""

    name: str
    left: Path
    right: Path
    skipped: int = 0


@dataclass(frozen=True)
class NamedPair(Pair):
    """A pair that is called as its pictures are: which ones are passed over nobody knows beforehand, so a number that
    counts the pairs taken would find the masks of others."""

    name: str = ""


def name_of(pair: NamedPair) -> str:
    """Return how the masks of a pair are called."""
    return pair.name


def read_rig(path: Path) -> tuple[StereoRig, float]:
    """Read rig.json: a rectified pair, and the needle's radius [m], the usual one where it names none. Raises BadInput
    in one line."""
    try:
        record = RigFile.model_validate(file_json(path, LARGEST_PICTURE, hint=RIG_HINT), strict=False)
    except ValidationError as error:
        raise BadInput(f"{path}: {first_problem(error)}", hint=RIG_HINT) from None
    camera = record.camera
    if min(camera.fx, camera.fy) <= 0 or abs(camera.fx / camera.fy - 1.0) > SQUARE:
        raise BadInput(
            f"{path}: fx {camera.fx:g} and fy {camera.fy:g} are no square pixels", hint="rectify to square pixels"
        )
    rig = StereoRig(camera.width, camera.height, camera.fx, (camera.cx, camera.cy), record.baseline)
    return rig, record.needle_radius or NEEDLE_RADIUS


def named_pairs(lines: TextIO | Iterable[str]) -> Iterator[PairFiles]:
    """Yield the pairs that lines name: two paths with white space between. Raises BadInput for another line."""
    for number, line in enumerate(lines, start=1):
        words = line.split()
        if len(words) != 2:
            raise BadInput(f"line {number} of the pipe names {len(words)} files, not two", hint="left.png right.png")
        yield PairFiles(Path(words[0]).stem.removesuffix("_left"), Path(words[0]), Path(words[1]))


def growing_pairs(folder: Path, *, latest: bool, idle: float, poll: float = 0.02) -> Iterator[PairFiles]:
    """Yield the pairs of a folder as they become whole, until none came for `idle` seconds (0: what is there, once).

    `latest`: of those that wait, the last alone. Raises BadInput where there is no folder.
    """
    if not folder.is_dir():
        raise BadInput(f"{folder}: no folder of images", hint="make it before they arrive")
    done: set[str] = set()
    sizes: dict[str, tuple[int, ...]] = {}
    last = time.monotonic()
    while True:
        pairs = {name: pair for name, pair in _pairs_in(folder).items() if name not in done}
        stamps = {name: _stamp(pair) for name, pair in pairs.items()}
        complete = sorted(name for name in pairs if stamps[name] and (idle == 0.0 or sizes.get(name) == stamps[name]))
        sizes = stamps
        for name in complete[-1:] if latest else complete[:1]:
            skipped = len(complete) - 1 if latest else 0
            done.update(complete if latest else (name,))
            left, right = pairs[name]
            yield PairFiles(name, left, right, skipped)
            last = time.monotonic()
        if not complete:
            if time.monotonic() - last >= idle:
                return
            time.sleep(poll)


def _pairs_in(folder: Path) -> dict[str, tuple[Path, Path]]:
    names = {path.name for path in folder.iterdir()}
    pairs = {}
    for name in names:
        for ending in ENDINGS:
            stem = name.removesuffix(f"_left{ending}")
            if stem != name and f"{stem}_right{ending}" in names:
                pairs[stem] = (folder / name, folder / f"{stem}_right{ending}")
    return pairs


def _stamp(pair: tuple[Path, Path]) -> tuple[int, ...]:
    """Return size and time of both files; empty where one is gone or empty."""
    try:
        states = [path.stat() for path in pair]
    except OSError:
        return ()
    return () if min(s.st_size for s in states) == 0 else tuple(v for s in states for v in (s.st_size, s.st_mtime_ns))


Window = tuple[slice, slice]
"""Rows and columns of a picture."""


def windows_about(rig: StereoRig, pose: NeedlePose, reach: float) -> tuple[Window, Window]:
    """Return the windows of both eyes that show a needle at `pose`, wider by `reach` [px] on every side; empty where it
    is out of the picture."""
    points = pose.points(ARC)
    left, right = (_box(pixels, reach, rig) for pixels in (rig.left(points), rig.right(points)))
    return left, right


def _box(pixels: np.ndarray, reach: float, rig: StereoRig) -> Window:
    low, high = np.nanmin(pixels, axis=0) - reach, np.nanmax(pixels, axis=0) + reach
    columns, rows = ((int(max(a, 0)), int(max(b, 0)) + 1) for a, b in zip(low, high, strict=True))
    return slice(rows[0], min(rows[1], rig.height)), slice(columns[0], min(columns[1], rig.width))


def masks_within(make: MaskMaker, pair: Pair, windows: tuple[Window, Window]) -> EyeMasks:
    """Return the masks of what these windows show, in masks of the whole pictures."""
    cut = replace(pair, left=pair.left[windows[0]], right=pair.right[windows[1]])
    eye_masks, size = make(cut), pair.left.shape[:2]

    def whole(masks: tuple[Any, Any]) -> Any:
        return tuple(_paste(mask, window, size) for mask, window in zip(masks, windows, strict=True))

    hidden = eye_masks.hidden if eye_masks.hidden[0] is None else whole(eye_masks.hidden)
    return EyeMasks(whole(eye_masks.needle), whole(eye_masks.thread), hidden)


def _paste(mask: np.ndarray, window: Window, size: tuple[int, ...]) -> np.ndarray:
    picture = np.zeros(size, dtype=bool)
    picture[window] = mask
    return picture


class Follower:
    """Turns pairs into lines. Where one pair showed the needle the next is looked at first, in a window of each picture
    where masks are made of pictures (`cuts`) and with fewer starts; where that gives no pose, all of it is."""

    def __init__(self, rig: StereoRig, make: MaskMaker, radius: float, seed: int = 0, *, cuts: bool = False) -> None:
        self._rig, self._make, self._radius, self._seed = as_if_usual(rig, radius), make, radius, seed
        self._cuts = cuts
        self._guess: NeedlePose | None = None
        self._count = 0

    def ready(self) -> None:
        """Look for a drawn needle once, so that what has to be loaded or compiled is so before the first pair arrives:
        that takes most of a minute where nothing was compiled on this machine yet."""
        rig, size = self._rig, (self._rig.height, self._rig.width)
        matrix = np.eye(4)
        matrix[2, 3] = np.clip(4.0 * NEEDLE_RADIUS * rig.focal / rig.height, 2.0 * NEAREST, 0.9 * FARTHEST)
        points = NeedlePose(matrix).points(ARC)
        masks = [np.zeros(size, np.uint8) for _ in range(2)]
        for mask, pixels in zip(masks, (rig.left(points), rig.right(points)), strict=True):
            cv2.polylines(mask, [np.round(pixels).astype(np.int32)], False, 1, 3)
        if self._cuts:
            black = np.zeros((*size, 3), np.uint8)
            self._make(NamedPair(0, 0.0, 0, black, black))
        estimate(NeedleObservation(rig, masks[0] > 0, masks[1] > 0, None), self._seed, NeedlePose(matrix), near=True)

    def line(self, files: PairFiles) -> dict[str, Any]:
        """Return what is known of the needle in a pair: `camera_from_needle` (4, 4) [m], `covariance` (6, 6),
        `tip_probability`, `abstained`, `whole` (whether all of both pictures was looked at), and what it took. A
        picture that cannot be used is an abstention; with one comes no pose, as a robot may act on these lines."""
        began = time.monotonic()
        record: dict[str, Any] = {"name": files.name, "frame": self._count, "whole": True}
        try:
            pictures = self._picture(files.left), self._picture(files.right)
            pair = NamedPair(self._count, 0.0, 0, *pictures, name=files.name)
            record["taken"] = files.left.stat().st_mtime
            masks = None if self._cuts else self._make(pair)
            answer = self._near(pair, masks)
            record["whole"] = answer is None
            if answer is None:
                eye_masks = masks or self._make(pair)
                answer = estimate(eye_masks.observation(self._rig, None, pair.pictures), self._seed, self._guess)
        except BadInput as error:
            self._guess = None
            record |= UNKNOWN | {"abstained": str(error)}
        else:
            self._guess = None if answer.abstained else answer.pose
            record |= as_estimate_record(in_metres(answer, self._radius)).model_dump(mode="json")
            if answer.abstained:
                record |= UNKNOWN
        self._count += 1
        return record | {"skipped": files.skipped, "seconds": round(time.monotonic() - began, 4)}

    def _near(self, pair: Pair, masks: EyeMasks | None) -> NeedleEstimate | None:
        """Return the needle near where it was, in the pair's masks or those of the windows alone; None where it is not
        found there, or reaches out of the windows."""
        if self._guess is None:
            return None
        windows = windows_about(self._rig, self._guess, self._reach(self._guess) + RIM)
        if masks is None:
            if any(side.stop - side.start < 2 * RIM for window in windows for side in window):
                return None
            masks = masks_within(self._make, pair, windows)
        answer = estimate(masks.observation(self._rig, None, pair.pictures), self._seed, self._guess, near=True)
        if answer.abstained or answer.pose is None:
            return None
        if np.linalg.norm(answer.pose.centre - self._guess.centre) > AROUND:
            return None
        around_needle = windows_about(self._rig, answer.pose, 0.0)
        inside = all(
            window.start <= side.start and side.stop <= window.stop
            for eye, needle_windows in zip(windows, around_needle, strict=True)
            for window, side in zip(eye, needle_windows, strict=True)
        )
        return answer if inside else None

    def _reach(self, pose: NeedlePose) -> float:
        return self._rig.focal * AROUND / float(pose.centre[2])

    def _picture(self, path: Path) -> np.ndarray:
        """Return a picture (H, W, 3); without its pixels (H, W, 0) where masks are not made of it."""
        content = file_content(path, LARGEST_PICTURE, hint="give the images of both eyes")
        picture = _decode(content) if self._cuts else _size_alone(content)
        size = (self._rig.height, self._rig.width)
        if picture is None or picture.shape[:2] != size:
            shape_text = "no image" if picture is None else f"{picture.shape[1]} x {picture.shape[0]} pixels"
            raise BadInput(
                f"{path}: {shape_text}, the rig's are {size[1]} x {size[0]}", hint="rectified images of that size"
            )
        return picture


def _decode(content: bytes) -> np.ndarray | None:
    picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
    return None if picture is None else picture[..., ::-1]


def _size_alone(content: bytes) -> np.ndarray | None:
    size = image_size(content)
    return None if size is None else np.empty((size[1], size[0], 0), np.uint8)
