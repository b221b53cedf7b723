"""Depth as other sensors than structured light make it: coarse time of flight, holes, things that return nothing."""

from __future__ import annotations

import cv2
import numpy as np


def lose_things(depth: np.ndarray, instance: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return depth (H, W) without most of what some instances (black leather, glass, chrome, screens) should give."""
    result = depth.copy()
    for chosen in np.unique(instance[instance > 0]):
        if random.random() < 0.15:
            lost = smooth_noise(depth.shape, float(random.uniform(3, 20)), random) < random.uniform(0.4, 1.1)
            result[(instance == chosen) & lost] = 0
    return result


def smooth_noise(shape: tuple[int, ...], period: float, random: np.random.Generator) -> np.ndarray:
    """Return noise (H, W) of about uniform values in 0..1 that changes over `period` pixels."""
    coarse = random.random((max(2, int(shape[0] / period)), max(2, int(shape[1] / period))), dtype=np.float32)
    return np.clip(cv2.resize(coarse, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR), 0, 1)


def coarse_depth(true: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return what a time-of-flight camera of low resolution gives, brought back to the size of `true` (H, W) [m].

    In the order of the light's way: pixels that see two depths mix them, errors that change slowly over the image
    (multipath), noise that grows with depth, a border of nothing along depth jumps, blotches of nothing (clouds of dark
    or slanted surface), and an end of range.
    """
    height, width = true.shape
    factor = float(random.uniform(1.0, 3.0))
    size = (max(32, int(width / factor)), max(24, int(height / factor)))
    mixed = cv2.resize(true, size, interpolation=cv2.INTER_AREA if random.random() < 0.5 else cv2.INTER_NEAREST)
    nearest = cv2.resize(true, size, interpolation=cv2.INTER_NEAREST)
    mixed = np.where(nearest > 0, mixed, 0)
    slow = 1 + float(random.uniform(0.0, 0.015)) * (2 * smooth_noise(mixed.shape, size[0] / 4, random) - 1)
    noise = float(random.uniform(0.0005, 0.006)) * random.standard_normal(mixed.shape, dtype=np.float32)
    depth = (mixed * slow * (1 + noise)).astype(np.float32)
    around = np.ones((3, 3), np.uint8)
    jump = cv2.dilate(nearest, around) - cv2.erode(nearest, around) > 0.06 * np.maximum(nearest, 0.1)
    border = int(random.integers(0, 3))
    if border:
        jump = cv2.dilate(jump.astype(np.uint8), around, iterations=border) > 0
        depth[jump] = 0
    depth[smooth_noise(depth.shape, float(random.uniform(2, 25)), random) < random.uniform(0.0, 0.35)] = 0
    depth[depth > random.uniform(2.8, 7.0)] = 0
    depth[depth < random.uniform(0.1, 0.8)] = 0
    if random.random() < 0.4:
        depth = np.asarray(cv2.medianBlur(depth, 5 if random.random() < 0.5 else 3), np.float32)
    return cv2.resize(depth, (width, height), interpolation=cv2.INTER_NEAREST)
