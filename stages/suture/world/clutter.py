"""Pictures without a needle that tempt one to see it: highlights, streaks, blood; and masks made of wrong things.

A needle's mask is steel, thin and bent. What is not a needle and gets such masks: glints, the rims of jaws, thread.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from scenewright.stages.suture.rig import NEEDLE_RADIUS, StereoRig
from scenewright.stages.suture.world.render import Eye, StereoView
from scenewright.stages.suture.world.tubes import LEFT_DRIVER, RIGHT_DRIVER, THREAD

BLOOD = np.array([96.0, 10.0, 12.0])
"""Colour of blood (RGB); by eye."""
MOST_GLINTS, MOST_BLOOD = 14, 4
"""Most highlights and most stains of blood in one picture; by eye."""
SUBPIXEL = 3
"""Bits of cv2's fixed-point coordinates."""


def cluttered(view: StereoView, random: np.random.Generator) -> StereoView:
    """Return a view whose pictures show blood and highlights as well, at the same places of the scene in both eyes.

    Masks, depth and poses stay as they are. Raises ValueError for a view without pictures.
    """
    pictures = [view.left.image, view.right.image]
    if pictures[0] is None or pictures[1] is None:
        raise ValueError("clutter is drawn into images")
    painted = [picture.astype(np.float32) for picture in pictures if picture is not None]
    depth = float(np.median(view.left.depth[view.left.depth > 0]))
    for _ in range(int(random.integers(0, MOST_BLOOD + 1))):
        _paint(painted, _blot(view.rig, random), BLOOD * random.uniform(0.5, 1.3), view.rig, depth)
    for _ in range(int(random.integers(2, MOST_GLINTS + 1))):
        at = depth * random.uniform(0.9, 1.1)
        _paint(painted, _glint(view.rig, random), np.full(3, random.uniform(170.0, 255.0)), view.rig, at)
    images = [np.clip(picture + 0.5, 0, 255).astype(np.uint8) for picture in painted]
    return replace(view, left=replace(view.left, image=images[0]), right=replace(view.right, image=images[1]))


def _glint(rig: StereoRig, random: np.random.Generator) -> np.ndarray:
    """Return the opacity (H, W) 0..1 of a highlight in the left eye: a spot, a streak or a bent line."""
    canvas = np.zeros((rig.height, rig.width), np.float32)
    middle = random.uniform([0.1, 0.1], [0.9, 0.9]) * [rig.width, rig.height]
    size, thick = random.uniform(4.0, 70.0), int(random.integers(1, 6))
    turn, kind = random.uniform(0.0, 360.0), int(random.choice(3, p=(0.45, 0.4, 0.15)))
    centre = np.round(middle * 2**SUBPIXEL).astype(int).tolist()
    if kind == 0:
        axes = np.round(np.array([size, size * random.uniform(0.2, 0.8)]) / 3 * 2**SUBPIXEL).astype(int).tolist()
        cv2.ellipse(canvas, centre, axes, turn, 0, 360, 1.0, -1, cv2.LINE_AA, SUBPIXEL)
    elif kind == 1:
        half_length = size * np.array([np.cos(turn), np.sin(turn)])
        ends = [np.round((middle + side * half_length) * 2**SUBPIXEL).astype(int).tolist() for side in (-1, 1)]
        cv2.line(canvas, ends[0], ends[1], 1.0, thick, cv2.LINE_AA, SUBPIXEL)
    else:
        axes = np.round(np.array([size, size * random.uniform(0.3, 1.0)]) * 2**SUBPIXEL).astype(int).tolist()
        cv2.ellipse(canvas, centre, axes, turn, 0, random.uniform(30, 120), 1.0, thick, cv2.LINE_AA, SUBPIXEL)
    return random.uniform(0.5, 1.0) * cv2.GaussianBlur(canvas, (0, 0), random.uniform(0.6, 2.0))


def _blot(rig: StereoRig, random: np.random.Generator) -> np.ndarray:
    """Return the opacity (H, W) 0..1 of blood in the left eye: a smooth blot of any form."""
    small: np.ndarray = cv2.GaussianBlur(random.standard_normal((60, 80)).astype(np.float32), (0, 0), 4.0)
    rows, columns = np.mgrid[0:60, 0:80]
    middle, reach = random.uniform([10, 10], [50, 70]), random.uniform(4.0, 16.0)
    falloff = np.exp(-((rows - middle[0]) ** 2 + (columns - middle[1]) ** 2) / (2 * reach**2))
    blot = (falloff * (1.0 + 4.0 * small) > 0.5).astype(np.float32)
    full_size = cv2.resize(blot, (rig.width, rig.height), interpolation=cv2.INTER_CUBIC)
    return random.uniform(0.5, 0.9) * cv2.GaussianBlur(np.clip(full_size, 0.0, 1.0), (0, 0), 5.0)


def _paint(pictures: list[np.ndarray], opacity: np.ndarray, colour: np.ndarray, rig: StereoRig, depth: float) -> None:
    """Paint over both pictures what the left eye sees at `depth` [m]."""
    shift = np.array([[1.0, 0.0, -rig.focal * rig.baseline / depth], [0.0, 1.0, 0.0]])
    moved = cv2.warpAffine(opacity, shift, (opacity.shape[1], opacity.shape[0]))
    for picture, part in zip(pictures, (opacity, moved), strict=True):
        picture += part[..., None] * (colour - picture)


def false_masks(view: StereoView, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return needle masks (H, W) bool of both eyes for a view without a needle: stretches of thread and of the jaws'
    rims, most of them of the same things in both eyes; or glints, few or very many."""
    masks = [np.zeros(eye.bodies.shape, np.uint8) for eye in (view.left, view.right)]
    if random.random() < 0.5:
        _scatter(masks, view, random)
        return masks[0] > 0, masks[1] > 0
    for _ in range(int(random.integers(1, 7))):
        of_thread = int(random.integers(2))
        radius, position = random.uniform(10.0, 60.0), random.random()
        for mask, eye in zip(masks, (view.left, view.right), strict=True):
            if random.random() < 0.9:
                _take(mask, _thread(eye) if of_thread else _rims(eye), position, radius)
    return masks[0] > 0, masks[1] > 0


def _scatter(masks: list[np.ndarray], view: StereoView, random: np.random.Generator) -> None:
    """Add 5 to 200 round glints about where the needle would be, on a surface that is not flat."""
    rig, middle = view.rig, view.rig.left(view.pose.centre[None])[0]
    spread = random.uniform(0.5, 4.0) * NEEDLE_RADIUS * rig.focal / view.pose.centre[2]
    for _ in range(int(np.exp(random.uniform(np.log(5.0), np.log(200.0))))):
        pixel, depth = middle + random.normal(0.0, spread, 2), view.pose.centre[2] * random.normal(1.0, 0.01)
        radius = random.uniform(1.0, 6.0)
        for mask, shift in zip(masks, (0.0, rig.focal * rig.baseline / depth), strict=True):
            if random.random() < 0.9:
                cv2.circle(mask, (round(pixel[0] - shift), round(pixel[1])), round(radius), 1, -1)


def _thread(eye: Eye) -> np.ndarray:
    return eye.mask(THREAD)


def _rims(eye: Eye) -> np.ndarray:
    drivers = eye.mask(LEFT_DRIVER, RIGHT_DRIVER).astype(np.uint8)
    return (drivers > 0) & (cv2.erode(drivers, np.ones((5, 5), np.uint8)) == 0)


def _take(mask: np.ndarray, source: np.ndarray, place: float, radius: float) -> None:
    """Add to `mask` what of `source` lies within `radius` [px] of its pixel at the share `place`, in order of rows."""
    pixels = np.argwhere(source)
    if len(pixels):
        row, column = pixels[int(place * (len(pixels) - 1))]
        disk = np.zeros(mask.shape, np.uint8)
        cv2.circle(disk, (int(column), int(row)), round(radius), 1, -1)
        mask[(disk > 0) & source] = 1
