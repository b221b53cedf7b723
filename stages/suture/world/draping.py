"""Pictures without a needle that have edges like one's: cloth, folds, cut tissue, shadowed rims, instruments, thread.

What is drawn lies before the pad at one depth each, so that both eyes see it at places that agree, as a rim's two sides
do. Shapes are closed bent outlines (cloth, flaps of tissue) and bent bands (cuts, instruments, thread).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scenewright.stages.suture.rig import NEEDLE_RADIUS, StereoRig
from scenewright.stages.suture.world.clutter import SUBPIXEL
from scenewright.stages.suture.world.render import StereoView

CLOTHS = np.array([[150, 25, 30], [40, 95, 80], [45, 75, 130], [200, 195, 190], [110, 20, 25]], dtype=float)
"""Colours of cloth (RGB): red, green and blue drapes, gauze, gauze with blood; by eye."""
TISSUES = np.array([[190, 90, 80], [160, 60, 55], [205, 140, 110], [120, 40, 40]], dtype=float)
"""Colours of tissue (RGB); by eye."""
THREADS = np.array([[95, 45, 120], [30, 30, 34], [40, 70, 140], [205, 200, 190]], dtype=float)
"""Colours of thread (RGB): violet, black, blue, white; by eye."""
MOST = 5
"""Most things that are laid into one picture; by eye."""
STEPS = 160
"""Points of a drawn line."""


@dataclass
class _Canvas:
    """Both eyes' pictures (H, W, 3) float32, and what places things: the rig, the pad's depth [m], a needle's radius
    there [px]."""

    pictures: list[np.ndarray]
    rig: StereoRig
    depth: float
    radius: float

    def lay(self, opacity: np.ndarray, colour: np.ndarray, depth: float) -> None:
        """Paint `colour` (H, W, 3) or (3,) with `opacity` (H, W) 0..1, both as the left eye sees them, at `depth`."""
        size = (opacity.shape[1], opacity.shape[0])
        move = np.array([[1.0, 0.0, -self.rig.focal * self.rig.baseline / depth], [0.0, 1.0, 0.0]])
        for eye, picture in enumerate(self.pictures):
            seen, painted = opacity, colour
            if eye:
                seen = cv2.warpAffine(opacity, move, size, borderMode=cv2.BORDER_REFLECT)
                if colour.ndim == 3:
                    painted = cv2.warpAffine(colour, move, size, borderMode=cv2.BORDER_REFLECT)
            picture += seen[..., None] * (painted - picture)

    def shade(self, factor: np.ndarray, depth: float) -> None:
        """Multiply both pictures by `factor` (H, W), as the left eye sees it at `depth`."""
        move = np.array([[1.0, 0.0, -self.rig.focal * self.rig.baseline / depth], [0.0, 1.0, 0.0]])
        moved = cv2.warpAffine(factor, move, (factor.shape[1], factor.shape[0]), borderMode=cv2.BORDER_REFLECT)
        for picture, seen in zip(self.pictures, (factor, moved), strict=True):
            picture *= seen[..., None]


def draped(view: StereoView, random: np.random.Generator) -> StereoView:
    """Return a view whose pictures show cloth, folds, cuts, flaps with shadowed rims, instruments and loose thread too.

    Masks, depth and poses stay as they are. Raises ValueError for a view without pictures.
    """
    pictures = [view.left.image, view.right.image]
    if pictures[0] is None or pictures[1] is None:
        raise ValueError("drapes are drawn into images")
    depth = float(np.median(view.left.depth[view.left.depth > 0]))
    painted = [picture.astype(np.float32) for picture in pictures if picture is not None]
    canvas = _Canvas(painted, view.rig, depth, NEEDLE_RADIUS * view.rig.focal / depth)
    things: list[Callable[[_Canvas, np.random.Generator], None]] = [_sheet, _sheet, _cut, _instrument, _loose_thread]
    if random.random() < 0.5:
        _cover_with_tissue(canvas, random)
    for _ in range(int(random.integers(1, MOST + 1))):
        things[int(random.integers(len(things)))](canvas, random)
    noise = random.uniform(1.0, 3.0)
    images = [
        np.clip(picture + random.normal(0.0, noise, picture.shape) + 0.5, 0, 255).astype(np.uint8)
        for picture in painted
    ]
    return replace(view, left=replace(view.left, image=images[0]), right=replace(view.right, image=images[1]))


def _mottle(canvas: _Canvas, random: np.random.Generator, grain: float) -> np.ndarray:
    """Return smooth noise (H, W) of about unit variance with grains of `grain` [px]."""
    rows, columns = (int(side / grain) + 8 for side in (canvas.rig.height, canvas.rig.width))
    small = cv2.GaussianBlur(random.standard_normal((rows, columns)).astype(np.float32), (0, 0), 1.0) * 3.0
    return np.asarray(cv2.resize(small, (canvas.rig.width, canvas.rig.height), interpolation=cv2.INTER_CUBIC))


def _cover_with_tissue(canvas: _Canvas, random: np.random.Generator) -> None:
    """Cover the pad with wet tissue: mottled, with vessels of its own shade and small wet lights."""
    grey = 1.0 + 0.18 * _mottle(canvas, random, 90.0) + 0.06 * _mottle(canvas, random, 8.0)
    colour = (TISSUES[random.integers(len(TISSUES))] * random.uniform(0.6, 1.2) * grey[..., None]).astype(np.float32)
    colour += 200.0 * np.clip(_mottle(canvas, random, 12.0) - 2.3, 0.0, 1.0)[..., None]
    canvas.lay(np.full(grey.shape, random.uniform(0.7, 1.0), np.float32), colour, canvas.depth)


def _outline(canvas: _Canvas, random: np.random.Generator) -> np.ndarray:
    """Return the signed distance (H, W) float32 [px] to a closed bent outline, negative inside."""
    angles = np.linspace(0.0, 2.0 * np.pi, 4 * STEPS)
    size = canvas.radius * float(np.exp(random.uniform(np.log(0.7), np.log(12.0))))
    reach = np.ones_like(angles)
    for order in range(2, 7):
        reach += random.normal(0.0, 0.25) / order * np.cos(order * angles + random.uniform(0.0, 2.0 * np.pi))
    rig = canvas.rig
    at = random.uniform([0.15, 0.15], [0.85, 0.85]) * [rig.width, rig.height]
    towards = random.uniform(0.0, 2.0 * np.pi)
    middle = at - 0.9 * size * np.array([np.cos(towards), np.sin(towards)])
    points = middle + size * reach[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    inside = np.zeros((rig.height, rig.width), np.uint8)
    cv2.fillPoly(inside, [np.round(points * 2**SUBPIXEL).astype(np.int32)], 1, cv2.LINE_8, SUBPIXEL)
    far, near = (cv2.distanceTransform(part, cv2.DIST_L2, 5) for part in (1 - inside, inside))
    return np.asarray(np.where(inside > 0, 0.5 - near, far - 0.5), dtype=np.float32)


def _sheet(canvas: _Canvas, random: np.random.Generator) -> None:
    """Lay a sheet of cloth, or a flap of tissue, over what is there: folds, a shadow beside its rim, a lit one."""
    distance = _outline(canvas, random)
    of_cloth = random.random() < 0.6
    colours = CLOTHS if of_cloth else TISSUES
    base = colours[random.integers(len(colours))] * random.uniform(0.5, 1.2)
    rows, columns = np.mgrid[: canvas.rig.height, : canvas.rig.width].astype(np.float32)
    turn, pitch = random.uniform(0.0, np.pi), canvas.radius * random.uniform(0.3, 2.0)
    along = (columns * np.cos(turn) + rows * np.sin(turn)) / pitch + 0.4 * _mottle(canvas, random, 150.0)
    folds = random.uniform(0.0, 0.45) * (2.0 * np.abs(np.sin(along)) ** random.uniform(0.3, 2.0) - 1.0)
    grain = _mottle(canvas, random, 3.0 if of_cloth else 10.0)
    grey = 1.0 + folds + 0.05 * grain
    colour = (base * grey[..., None]).astype(np.float32)
    rim = canvas.radius / 12.0 * random.uniform(0.3, 1.5)
    light = random.uniform(-0.8, 1.2) * np.exp(-(((distance + rim) / (0.7 * rim)) ** 2))
    colour += (light * random.uniform(40.0, 110.0))[..., None]
    shadow = random.uniform(0.0, 0.85) * np.exp(-((np.maximum(distance, 0.0) / (2.5 * rim)) ** 2))
    depth = canvas.depth * (1.0 - random.uniform(0.01, 0.08))
    canvas.shade((1.0 - shadow).astype(np.float32), 0.5 * (depth + canvas.depth))
    blur = random.uniform(0.5, 1.5)
    canvas.lay(1.0 / (1.0 + np.exp(np.clip(distance / (0.5 * blur), -30.0, 30.0))).astype(np.float32), colour, depth)


def _band(canvas: _Canvas, random: np.random.Generator, longest: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the distance (H, W) [px] to a bent line of at most `longest` of a needle's radii, and how far along it (0
    to 1) the nearest point of the line lies."""
    rig = canvas.rig
    length = canvas.radius * random.uniform(0.6, longest)
    turning = random.choice([0.0, 1.0, 1.0]) * random.uniform(-1.0, 1.0) * 1.6 * length / canvas.radius
    turns = random.uniform(0.0, 2.0 * np.pi) + turning * np.linspace(-0.5, 0.5, STEPS)
    turns += random.normal(0.0, 0.4) * np.sin(np.linspace(0.0, 2.0 * np.pi * random.uniform(0.5, 1.5), STEPS))
    line = np.cumsum(np.stack([np.cos(turns), np.sin(turns)], axis=1), axis=0) * length / STEPS
    line += random.uniform([0.2, 0.2], [0.8, 0.8]) * [rig.width, rig.height] - line.mean(axis=0)
    empty = np.full((rig.height, rig.width), 255, np.uint8)
    cv2.polylines(empty, [np.round(line * 2**SUBPIXEL).astype(np.int32)], False, 0, 1, cv2.LINE_8, SUBPIXEL)
    distance, labels = cv2.distanceTransformWithLabels(empty, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    rows, columns = np.nonzero(empty == 0)
    nearest = np.hypot(columns[:, None] - line[:, 0], rows[:, None] - line[:, 1]).argmin(axis=1) / (STEPS - 1)
    share = np.zeros(int(labels.max()) + 1, np.float32)
    share[labels[rows, columns]] = nearest
    return np.asarray(distance), share[labels]


def _within(distance: np.ndarray, width: np.ndarray | float, blur: float = 0.6) -> np.ndarray:
    """Return the opacity (H, W) 0..1 of a band of half `width` [px]."""
    return np.asarray(1.0 / (1.0 + np.exp(np.clip((distance - width) / blur, -30.0, 30.0))), dtype=np.float32)


def _cut(canvas: _Canvas, random: np.random.Generator) -> None:
    """Lay a cut into what is there: a dark slit, wide in its middle, between pale or wet lips."""
    distance, share = _band(canvas, random, 4.0)
    width = canvas.radius / 12.0 * random.uniform(0.5, 2.5) * np.sqrt(np.clip(4.0 * share * (1.0 - share), 0.0, 1.0))
    lips = TISSUES[random.integers(len(TISSUES))] * random.uniform(0.9, 1.5)
    depth = canvas.depth * random.uniform(0.97, 1.0)
    canvas.lay(random.uniform(0.2, 0.9) * _within(distance, 2.2 * width, 1.0), lips, depth)
    canvas.lay(random.uniform(0.5, 1.0) * _within(distance, width), lips * random.uniform(0.05, 0.35), depth)


def _instrument(canvas: _Canvas, random: np.random.Generator) -> None:
    """Lay a steel instrument over what is there, straight or bent: at least three times as wide as a needle's wire."""
    distance, _ = _band(canvas, random, 15.0)
    width = canvas.radius / 24.0 * random.uniform(3.0, 9.0)
    across = np.clip(distance / width, 0.0, 1.0)
    grey = 60.0 + 90.0 * np.sqrt(1.0 - across**2) * random.uniform(0.4, 1.0)
    grey += random.uniform(0.0, 150.0) * np.exp(-(((across - random.uniform(0.0, 0.7)) / 0.2) ** 2))
    depth = canvas.depth * (1.0 - random.uniform(0.02, 0.1))
    canvas.shade(1.0 - 0.5 * _within(distance, 1.3 * width, 0.4 * width), canvas.depth)
    canvas.lay(_within(distance, width), np.repeat(grey[..., None], 3, axis=2).astype(np.float32), depth)


def _loose_thread(canvas: _Canvas, random: np.random.Generator) -> None:
    """Lay a loose thread over what is there."""
    distance, share = _band(canvas, random, 8.0)
    width = canvas.radius / 12.0 * random.uniform(0.12, 0.35)
    colour = THREADS[random.integers(len(THREADS))] * random.uniform(0.6, 1.3)
    twisted = 1.0 + 0.15 * np.sin(share * random.uniform(100.0, 400.0))
    depth = canvas.depth * (1.0 - random.uniform(0.0, 0.08))
    canvas.lay(_within(distance, width), (colour * twisted[..., None]).astype(np.float32), depth)
