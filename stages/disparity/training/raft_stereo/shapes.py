"""Pairs of random shapes: slanted planes, thin curves and blank surfaces before each other, with exact disparity.

A layer has a disparity that is linear in the left picture, d = a + b x + c y, so that both eyes see it through an
affine map of one drawn canvas and nothing is interpolated twice. Layers are painted from far to near in both eyes.
"""

from __future__ import annotations

import cv2
import numpy as np

CANVAS = (176, 464)
"""Rows and columns of a drawn texture [px]."""
LARGEST = 70.0
"""Disparities of layers end here [px]."""
Window = tuple[np.ndarray, np.ndarray]
"""Low and high (column, row) on the canvas."""
Layer = tuple[np.ndarray, np.ndarray | None, tuple[float, float, float]]
"""Colours (H, W, 3) float32, opacity (H, W) float32 or None for everywhere, (a, b, c) of the disparity."""


def texture_bank(seed: int, count: int) -> list[np.ndarray]:
    """Return textures (*CANVAS, 3) uint8: clouds of several sizes, stripes, spots, and surfaces that are nearly
    blank."""
    return [_texture(np.random.default_rng([seed, 31, number]), number % 5) for number in range(count)]


def _texture(random: np.random.Generator, kind: int) -> np.ndarray:
    base, gain = random.uniform(40, 215, 3), random.uniform(-1, 1, 3)
    if kind == 4:
        pattern = 6.0 * _clouds(random, (40.0,)) + random.uniform(0, 2) * _clouds(random, (1.0,))
        return _bytes(base + pattern[..., None] * np.sign(gain))
    if kind in (0, 1):
        sizes = tuple(np.exp(random.uniform(np.log(0.8), np.log(24), random.integers(1, 4))))
        return _bytes(base + random.uniform(15, 60) * _clouds(random, sizes)[..., None] * gain)
    rows, columns = np.indices(CANVAS, dtype=np.float32)
    if kind == 2:
        turn, wave = random.uniform(0, np.pi), random.uniform(5, 40)
        stripes = np.sin(2 * np.pi * (columns * np.cos(turn) + rows * np.sin(turn)) / wave)
        pattern = random.uniform(15, 60) * np.tanh(random.uniform(0.5, 5) * stripes) + 8 * _clouds(random, (3.0,))
        return _bytes(base + pattern[..., None] * gain)
    picture = _bytes(np.broadcast_to(base, (*CANVAS, 3)) + 5 * _clouds(random, (12.0,))[..., None])
    for _ in range(int(random.integers(30, 300))):
        place = [int(v) for v in random.uniform(0, 16 * np.array(CANVAS[::-1]))]
        axes = [int(v) for v in 16 * np.exp(random.uniform(0, 2.5, 2))]
        color = [int(v) for v in random.uniform(0, 255, 3)]
        cv2.ellipse(picture, place, axes, random.uniform(0, 180), 0, 360, color, -1, cv2.LINE_AA, 4)
    return picture


def _clouds(random: np.random.Generator, sizes: tuple[float, ...]) -> np.ndarray:
    """Return noise (*CANVAS) float32 of unit deviation whose spots have these sizes [px]."""
    total = np.zeros(CANVAS, np.float32)
    for size in sizes:
        shrink = max(1, int(size / 1.5))
        small: np.ndarray = random.standard_normal((CANVAS[0] // shrink + 2, CANVAS[1] // shrink + 2), dtype=np.float32)
        small = cv2.GaussianBlur(small, (0, 0), size / shrink)
        total += cv2.resize(small / small.std(), CANVAS[::-1], interpolation=cv2.INTER_CUBIC)
    return total / np.sqrt(len(sizes))


def _bytes(values: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def shapes_pair(
    bank: list[np.ndarray], random: np.random.Generator, height: int, width: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return left and right (height, width, 3) float32 RGB, 0 to 255, and the disparity (height, width) float32 [px] of
    the left, known everywhere, hidden places too."""
    far = random.uniform(2, 28)
    corner = random.uniform([0, 0], [CANVAS[1] - width - 170, CANVAS[0] - height])
    window = (corner, corner + [width + 0.5 * far, height])
    slope = 0.15 * random.random() ** 2
    layers: list[Layer] = [(_colors(bank, random), None, _plane(random, far, slope, height, width))]
    nearer = np.sort(far + random.exponential(10, int(random.integers(1, 6))))
    for disparity in np.minimum(nearer, LARGEST):
        layers.append((_colors(bank, random), _shape(random, window), _plane(random, disparity, 0.08, height, width)))
    for _ in range(int(random.integers(0, 3))):
        near = min(layers[-1][2][0] + random.uniform(1, 15), LARGEST)
        layers.append((_colors(bank, random), _curve(random, window), _plane(random, near, 0.05, height, width)))
    left, right = np.zeros((height, width, 3), np.float32), np.zeros((height, width, 3), np.float32)
    truth = np.zeros((height, width), np.float32)
    rows, columns = np.indices((height, width), dtype=np.float32)
    size = (width, height)
    for colors, opacity, (a, b, c) in layers:
        straight = np.array([[1, 0, corner[0]], [0, 1, corner[1]]])
        moved = np.array([[1 / (1 - b), c / (1 - b), a / (1 - b) + corner[0]], [0, 1, corner[1]]])
        shares = []
        for picture, matrix in ((left, straight), (right, moved)):
            flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
            seen = cv2.warpAffine(colors, matrix, size, flags=flags, borderMode=cv2.BORDER_REFLECT)
            share: np.ndarray = np.ones((height, width), np.float32)
            if opacity is not None:
                share = cv2.warpAffine(opacity, matrix, size, flags=flags, borderMode=cv2.BORDER_CONSTANT)
            picture += share[..., None] * (seen - picture)
            shares.append(share)
        truth = np.where(shares[0] > 0.5, a + b * columns + c * rows, truth)
    return left, right, truth


def _colors(bank: list[np.ndarray], random: np.random.Generator) -> np.ndarray:
    """Return a texture of the bank, turned over and coloured by chance, (*CANVAS, 3) float32."""
    texture = bank[int(random.integers(len(bank)))][:: int(random.choice((-1, 1))), :: int(random.choice((-1, 1)))]
    texture = texture[..., random.permutation(3)]
    return texture.astype(np.float32) * np.float32(random.uniform(0.5, 1.1))


def _plane(
    random: np.random.Generator, middle: float, slope: float, height: int, width: int
) -> tuple[float, float, float]:
    """Return (a, b, c) of a plane with a disparity of `middle` [px] in the picture's middle, positive everywhere."""
    b, c = np.clip(random.normal(0, slope, 2), -0.3, 0.3)
    steepest = 0.9 * middle / (abs(b) * width / 2 + abs(c) * height / 2 + 1e-6)
    b, c = b * min(1.0, steepest), c * min(1.0, steepest)
    return float(middle - b * width / 2 - c * height / 2), float(b), float(c)


def _shape(random: np.random.Generator, window: Window) -> np.ndarray:
    """Return the opacity (*CANVAS) float32 of a few polygons and ellipses in a window."""
    drawn = np.zeros(CANVAS, np.uint8)
    for _ in range(int(random.integers(1, 4))):
        place = random.uniform(*window)
        size = np.exp(random.uniform(np.log(14), np.log(130), 2))
        if random.random() < 0.4:
            ends = [int(v) for v in 16 * place], [int(v) for v in 16 * size]
            cv2.ellipse(drawn, ends[0], ends[1], random.uniform(0, 180), 0, 360, 255, -1, cv2.LINE_AA, 4)
        else:
            angles = np.sort(random.uniform(0, 2 * np.pi, int(random.integers(3, 8))))
            corners = place + size * np.stack([np.cos(angles), np.sin(angles)], axis=1)
            cv2.fillPoly(drawn, [np.rint(16 * corners).astype(np.int32)], 255, cv2.LINE_AA, 4)
    return drawn.astype(np.float32) / 255


def _curve(random: np.random.Generator, window: Window) -> np.ndarray:
    """Return the opacity (*CANVAS) float32 of thin bows in a window, as needles and threads are."""
    drawn = np.zeros(CANVAS, np.uint8)
    for _ in range(int(random.integers(1, 3))):
        turns = np.cumsum(random.normal(random.normal(0, 0.06), 0.03, 60))
        steps = random.uniform(2, 6) * np.stack([np.cos(turns), np.sin(turns)], axis=1)
        points = random.uniform(*window) + np.cumsum(steps, axis=0)
        thick = int(random.integers(1, 8))
        cv2.polylines(drawn, [np.rint(16 * points).astype(np.int32)], False, 255, thick, cv2.LINE_AA, 4)
    return drawn.astype(np.float32) / 255
