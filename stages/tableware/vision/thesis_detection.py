"""Vision as the thesis describes it: circles of known pixel radius by the Hough transform, utensils by slenderness.

Srinivas 2024, section 7.1: edges, contours and Hough circles filtered by the radii that cups and bowls have in the
image, clustered by their centres, overlapping ones removed; utensils are contours that are not too square, grasped at
the highest depth along the middle line of their box. It states no threshold: ours are here. Stacks are known from the
height at the circle's middle line alone.
"""

from __future__ import annotations

import cv2
import numpy as np
from scenewright.stages.tableware.vision.detections import Detection
from scenewright.stages.tableware.vision.height_map import HeightMap, height_map
from scenewright.stages.tableware.vision.rim_finding import Rim
from scenewright.stages.tableware.vision.stack_reading import read_stacks
from scenewright.stages.tableware.world.items import STANDARD as SIZES
from scenewright.stages.tableware.world.items import Kind
from scenewright.stages.tableware.world.overhead import OverheadCamera

CANNY = (60.0, 150.0)
"""Lower and upper threshold of the edges [grey levels]; by eye."""
VOTES = 26.0
"""Threshold of the accumulator of OpenCV's Hough transform; by eye."""
RADIUS_TOLERANCE = 0.14
"""A lip is nearer to the camera than the table, so circles appear larger by up to this share."""
CLUSTER = 0.02
"""Circles of a kind with centres this near are one [m]."""
SLENDER = 4.0
"""Length against width of a contour's box from which it is a utensil."""
LENGTH = (0.10, 0.20)
"""Least and largest length of a utensil [m]."""


def detect_thesis(color: np.ndarray, depth: np.ndarray, camera: OverheadCamera) -> tuple[Detection, ...]:
    """Return cups, bowls and utensils (all named forks: the thesis does not tell them apart). Arguments and errors are
    those of `detect`; plates are not known."""
    heights = height_map(color, depth, camera)
    gray = cv2.medianBlur(cv2.cvtColor(heights.color, cv2.COLOR_RGB2GRAY), 5)
    rims: list[Rim] = []
    kinds: tuple[Kind, ...] = ("bowl", "cup")
    for kind in kinds:
        rims.extend(_circles(gray, heights, kind))
    detections: list[Detection] = []
    covered = np.zeros(gray.shape, dtype=np.uint8)
    for stack in read_stacks(rims, SIZES):
        first = len(detections)
        for level, (kind, foot) in enumerate(zip(stack.kinds, stack.feet, strict=True)):
            on = first + level - 1 if level else None
            lip = foot + SIZES[kind].height
            detections.append(Detection(kind=kind, position=(stack.x, stack.y, foot), lip=lip, on=on))
        radius = 1.12 * SIZES[stack.kinds[0]].rim_radius * float(heights.scale(stack.top))
        u, v = heights.pixel(np.float64(stack.x), np.float64(stack.y), stack.top)
        cv2.circle(covered, (int(u), int(v)), int(radius), 1, -1)
    detections.extend(_bars(gray, heights, covered > 0))
    return tuple(detections)


def _circles(gray: np.ndarray, heights: HeightMap, kind: Kind) -> list[Rim]:
    expected = SIZES[kind].rim_radius * float(heights.scale(0.0))
    circles = cv2.HoughCircles(
        gray,
        cv2.HOUGH_GRADIENT,
        1.5,
        0.3 * expected,
        param1=CANNY[1],
        param2=VOTES,
        minRadius=int(expected),
        maxRadius=int(np.ceil((1.0 + RADIUS_TOLERANCE) * expected)),
    )
    rims: list[Rim] = []
    for u, v, radius in [] if circles is None else circles.reshape(-1, circles.shape[-1])[:, :3]:
        angles = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
        columns = np.clip(np.rint(u + 0.97 * radius * np.cos(angles)).astype(int), 0, gray.shape[1] - 1)
        rows = np.clip(np.rint(v + 0.97 * radius * np.sin(angles)).astype(int), 0, gray.shape[0] - 1)
        lip = float(np.percentile(heights.smooth[rows, columns], 75))
        if lip < 0.6 * SIZES[kind].height:
            continue  # a shadow or an edge on the table
        x, y = (float(value) for value in heights.world(np.float64(u), np.float64(v), lip))
        # Circles come with most votes first: what is near to or overlaps one of its kind that was taken is dropped.
        if all(np.hypot(x - r.x, y - r.y) > max(CLUSTER, 1.2 * SIZES[kind].rim_radius) for r in rims):
            rims.append(Rim(kind, x, y, lip, 1.0, 1.0))
    return rims


def _bars(gray: np.ndarray, heights: HeightMap, covered: np.ndarray) -> list[Detection]:
    edges = cv2.Canny(gray, *CANNY)
    edges[covered] = 0
    closed = cv2.morphologyEx(edges, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    contours, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    scale = float(heights.scale(0.003))
    bars = []
    for contour in contours:
        (u, v), (width, height), degrees = cv2.minAreaRect(contour)
        long, short = max(width, height), min(width, height)
        if not LENGTH[0] < long / scale < LENGTH[1] or long < SLENDER * max(short, 1.0):
            continue
        angle = np.deg2rad(degrees if width >= height else degrees + 90.0)
        along = np.linspace(-0.5 * long, 0.5 * long, 60)
        columns = np.clip(np.rint(u + along * np.cos(angle)).astype(int), 0, gray.shape[1] - 1)
        rows = np.clip(np.rint(v + along * np.sin(angle)).astype(int), 0, gray.shape[0] - 1)
        line = heights.smooth[rows, columns]
        k = int(np.argmax(line))
        x, y = heights.world(np.float64(u), np.float64(v), 0.003)
        gx, gy = heights.world(np.float64(columns[k]), np.float64(rows[k]), 0.003)
        bars.append(
            Detection(
                kind="fork",
                position=(float(x), float(y), 0.0),
                yaw=float(-angle),
                lip=SIZES["fork"].height,
                grasp=(float(gx), float(gy), float(line[k])),
            )
        )
    return bars
