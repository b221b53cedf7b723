"""Training samples of the needle and thread network: crops of rendered views, changed strongly.

Changes: place, scale, turn, mirror; light (gains, gamma, contrast, a slope of light, glare), colour of everything and
of the thread alone, saturation; blur, motion blur, noise; whole backgrounds of other patterns; cut-outs that hide;
blood over everything, and highlights that are thin, bright and bent as a needle is.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scenewright.stages.suture.segmentation.model import CLASSES
from scenewright.stages.suture.training.network.views import EYES, read_eye
from scenewright.stages.suture.world.tubes import LEFT_DRIVER, NEEDLE, RIGHT_DRIVER, THREAD

CROP = 192
"""Edge of a crop [px]."""
REACH = 196
"""A crop turned and made smaller by 0.7 reaches so far [px]."""
BODIES_OF = ((NEEDLE,), (THREAD,), (LEFT_DRIVER, RIGHT_DRIVER))
"""The bodies that each of CLASSES stands for."""
BEFORE_JAWS = 25
"""Side [px] of the square about a driver's pixel in which a needle lies before its jaws."""
HIDES = 0.9
"""What is painted over a thing more opaquely than this hides it."""
PICTURES_KEPT = 480
"""Decoded pictures that are kept in memory, 5 MB each."""


class Views:
    """The pictures of kept views (stems) with the masks of CLASSES; picture 2 i is view i's left eye."""

    def __init__(self, stems: list[Path]) -> None:
        self.stems = stems
        self._kept: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def __len__(self) -> int:
        return 2 * len(self.stems)

    def __getitem__(self, index: int) -> tuple[np.ndarray, np.ndarray]:
        """Return (picture (H, W, 3) uint8 RGB, bodies (H, W) uint8)."""
        if index not in self._kept:
            found = read_eye(self.stems[index // 2], EYES[index % 2])
            if len(self._kept) >= PICTURES_KEPT:
                return found
            self._kept[index] = found
        return self._kept[index]


def masks_of(bodies: np.ndarray) -> np.ndarray:
    """Return the masks (3, H, W) float32 of CLASSES in a map of bodies (H, W)."""
    assert len(CLASSES) == len(BODIES_OF)
    table = np.zeros((len(BODIES_OF), 256), dtype=np.float32)
    for row, chosen in zip(table, BODIES_OF, strict=True):
        row[list(chosen)] = 1.0
    return table[:, bodies]


def sample(
    picture: np.ndarray,
    bodies: np.ndarray,
    random: np.random.Generator,
    needles: float = 0.35,
    before_jaws: float = 0.0,
    clutter: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Return a changed crop (CROP, CROP, 3) uint8 and its targets (3, CROP, CROP) float32 in 0..1; a share `needles`
    (at most 0.75) of the crops lies about the needle, `before_jaws` of those where it is before a driver, and a share
    `clutter` shows blood and highlights."""
    crop, masks = _placed(picture, bodies, random, needles, before_jaws)
    image = crop.astype(np.float32) / 255.0
    if random.random() < 0.25:
        image = _before_other_background(image, masks, random)
    if random.random() < 0.35:
        image = _other_thread(image, masks[1], random)
    image = _lit(image, random)
    if clutter and random.random() < clutter:
        image, masks = _cluttered(image, masks, random)
    if random.random() < 0.4:
        image, masks = _cut_out(image, masks, random)
    image = _sensed(image, random)
    return (np.clip(image, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8), masks


def _placed(
    picture: np.ndarray, bodies: np.ndarray, random: np.random.Generator, needles: float, before_jaws: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return a crop about needle or thread (or anywhere), in half of the cases turned and scaled, mirrored, with soft
    masks."""
    rows, columns = bodies.shape
    wanted = random.choice([NEEDLE, THREAD, LEFT_DRIVER, 0], p=[needles, 0.75 - needles, 0.1, 0.15])
    chosen = bodies == wanted
    if wanted == NEEDLE and before_jaws and random.random() < before_jaws:
        drivers = np.isin(bodies, (LEFT_DRIVER, RIGHT_DRIVER)).astype(np.uint8)
        chosen = chosen & (cv2.dilate(drivers, np.ones((BEFORE_JAWS, BEFORE_JAWS), np.uint8)) > 0)
    places = np.flatnonzero(chosen)
    if len(places) == 0:
        places = np.arange(bodies.size)
    row, column = divmod(int(places[random.integers(len(places))]), columns)
    shift = random.integers(-CROP // 3, CROP // 3 + 1, 2)
    if random.random() < 0.5:
        top = int(np.clip(row + shift[0] - CROP // 2, 0, rows - CROP))
        left = int(np.clip(column + shift[1] - CROP // 2, 0, columns - CROP))
        window = np.s_[top : top + CROP, left : left + CROP]
        crop, masks = picture[window], masks_of(bodies[window])
    else:
        angle, scale = random.uniform(0.0, 360.0), float(np.exp(random.uniform(np.log(0.7), np.log(1.5))))
        middle = np.array([column + shift[1], row + shift[0]], dtype=float)
        # what a turned crop can reach, and no more, is warped
        low = np.clip(middle - REACH, 0, [columns - 1, rows - 1]).astype(int)
        window = np.s_[low[1] : int(middle[1]) + REACH, low[0] : int(middle[0]) + REACH]
        within = middle - low
        turn = cv2.getRotationMatrix2D((float(within[0]), float(within[1])), angle, scale)
        turn[:, 2] += CROP / 2 - within

        def turned(image: np.ndarray) -> np.ndarray:
            return cv2.warpAffine(image, turn, (CROP, CROP), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)

        crop = turned(picture[window])
        masks = np.stack([turned(mask) for mask in masks_of(bodies[window])])
    if random.random() < 0.5:
        crop, masks = crop[:, ::-1], masks[:, :, ::-1]
    if random.random() < 0.5:
        crop, masks = crop[::-1], masks[:, ::-1]
    return np.ascontiguousarray(crop), np.ascontiguousarray(masks)


def _pattern(random: np.random.Generator) -> np.ndarray:
    """Return a random smooth pattern (CROP, CROP, 3) float32 of two colours with grain of several sizes."""
    share = np.zeros((CROP, CROP), dtype=np.float32)
    for size in (2, 8, 32):
        coarse = random.standard_normal((max(CROP // size, 2), max(CROP // size, 2))).astype(np.float32)
        share += random.uniform(0.1, 0.6) * cv2.resize(coarse, (CROP, CROP), interpolation=cv2.INTER_CUBIC)
    share = (1.0 / (1.0 + np.exp(-share)))[..., None]  # type: ignore[assignment]
    first, second = random.uniform(0.05, 0.95, 3), random.uniform(0.05, 0.95, 3)
    return (share * first + (1.0 - share) * second).astype(np.float32)


def _before_other_background(image: np.ndarray, masks: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the picture with everything but needle, thread and drivers exchanged for a pattern."""
    share = cv2.GaussianBlur(np.clip(masks.sum(axis=0), 0.0, 1.0), (0, 0), 0.6)[..., None]
    return image * share + _pattern(random) * (1.0 - share)


def _other_thread(image: np.ndarray, thread: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the picture with the thread's colour turned: its brightness stays, its tint moves."""
    share = cv2.GaussianBlur(thread, (0, 0), 0.6)[..., None]
    grey = image.mean(axis=2, keepdims=True)
    tint = np.array([1.0, 0.5, 1.2]) * np.exp(random.normal(0.0, 0.25, 3))
    colour = grey * (tint / tint.mean()) * random.uniform(0.7, 1.2)
    return (image * (1.0 - share) + colour * share).astype(np.float32)


def _lit(image: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the picture in other light: slope, gains, gamma, contrast, saturation, spots of glare."""
    across, down = np.meshgrid(np.linspace(-1, 1, CROP, dtype=np.float32), np.linspace(-1, 1, CROP, dtype=np.float32))
    slope = 1.0 + random.uniform(-0.35, 0.35) * across + random.uniform(-0.35, 0.35) * down
    grey = image.mean(axis=2, keepdims=True)
    image = grey + (image - grey) * random.uniform(0.45, 1.4)
    image = np.clip(image, 0.0, 1.0) ** random.uniform(0.65, 1.5)
    image = image * slope[..., None] * random.uniform(0.6, 1.35) * random.uniform(0.85, 1.15, 3)
    image = (image - 0.45) * random.uniform(0.75, 1.25) + 0.45
    for _ in range(int(random.integers(0, 3)) if random.random() < 0.3 else 0):
        middle, size = random.uniform(-1, 1, 2), random.uniform(0.01, 0.12)
        glare = np.exp(-((across - middle[0]) ** 2 + (down - middle[1]) ** 2) / size**2)
        image = image + random.uniform(0.3, 1.0) * glare[..., None]
    return image.astype(np.float32)


def _cut_out(image: np.ndarray, masks: np.ndarray, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return picture and masks with up to three rectangles of one colour or of a pattern that hide what is there."""
    image, masks = image.copy(), masks.copy()
    for _ in range(int(random.integers(1, 4))):
        height, width = random.integers(6, 60, 2)
        top, left = random.integers(0, CROP - height), random.integers(0, CROP - width)
        window = np.s_[top : top + height, left : left + width]
        image[window] = _pattern(random)[window] if random.random() < 0.5 else random.uniform(0.0, 1.0, 3)
        masks[:, top : top + height, left : left + width] = 0.0
    return image, masks


def _cluttered(image: np.ndarray, masks: np.ndarray, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return the picture under up to two stains of blood and up to six highlights, and the masks without what these
    hide."""
    for _ in range(int(random.integers(0, 3))):
        image, masks = _painted(image, masks, _stain(random), _blood(random))
    for _ in range(int(random.integers(0, 7))):
        bright = random.uniform(0.55, 1.0) * random.uniform(0.93, 1.0, 3)
        image, masks = _painted(image, masks, _highlight(random), bright)
    return image, masks


def _painted(
    image: np.ndarray, masks: np.ndarray, opacity: np.ndarray, colour: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    share = opacity[..., None]
    return (image * (1.0 - share) + colour * share).astype(np.float32), masks * (opacity < HIDES)


def _blood(random: np.random.Generator) -> np.ndarray:
    return np.array([random.uniform(0.15, 0.55), *random.uniform(0.0, 0.1, 2)])


def _stain(random: np.random.Generator) -> np.ndarray:
    """Return the opacity (CROP, CROP) of a smooth stain of any form with a soft or a sharp edge."""
    size = int(random.integers(2, 7))
    coarse = random.standard_normal((size, size)).astype(np.float32)
    height: np.ndarray = cv2.resize(coarse, (CROP, CROP), interpolation=cv2.INTER_CUBIC)
    edge = np.clip((height - random.uniform(-1.0, 0.5)) * random.uniform(2.0, 12.0), 0.0, 1.0)
    return np.asarray(random.uniform(0.3, 0.95) * edge)


def _highlight(random: np.random.Generator) -> np.ndarray:
    """Return the opacity (CROP, CROP) of a spot, a straight streak, or a line that is bent by up to two thirds of a
    turn."""
    canvas = np.zeros((CROP, CROP), np.float32)
    middle = random.uniform(0.0, CROP, 2)
    turn, kind, thick = random.uniform(0.0, 360.0), int(random.integers(3)), int(random.integers(1, 8))
    size = float(np.exp(random.uniform(np.log(3.0), np.log(90.0))))
    axes = [max(int(size), 1), max(int(size * random.uniform(0.2, 1.0)), 1)]
    if kind == 0:
        spot = [max(axis // 3, 1) for axis in axes]
        cv2.ellipse(canvas, middle.astype(int).tolist(), spot, turn, 0, 360, 1.0, -1, cv2.LINE_AA)
    elif kind == 1:
        way = size * np.array([np.cos(turn), np.sin(turn)])
        first, last = ((middle + side * way).astype(int).tolist() for side in (-1, 1))
        cv2.line(canvas, first, last, 1.0, thick, cv2.LINE_AA)
    else:
        cv2.ellipse(
            canvas, middle.astype(int).tolist(), axes, turn, 0, random.uniform(20, 240), 1.0, thick, cv2.LINE_AA
        )
    return np.asarray(random.uniform(0.4, 1.0) * cv2.GaussianBlur(canvas, (0, 0), random.uniform(0.4, 2.0)))


def _sensed(image: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the picture blurred, moved during exposure, and noisy."""
    if random.random() < 0.5:
        image = cv2.GaussianBlur(image, (0, 0), random.uniform(0.3, 1.3))
    if random.random() < 0.15:
        length = int(random.integers(2, 6))
        kernel = np.zeros((7, 7), dtype=np.float32)
        angle = random.uniform(0.0, np.pi)
        for step in np.linspace(-length / 2, length / 2, 15):
            kernel[round(3 + step * np.sin(angle)), round(3 + step * np.cos(angle))] += 1.0
        image = cv2.filter2D(image, -1, kernel / kernel.sum())
    noise = random.standard_normal(image.shape, dtype=np.float32)
    return image + np.float32(random.uniform(0.0, 0.035)) * noise
