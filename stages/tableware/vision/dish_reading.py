"""The dishes of a stack as detections, with confidence and reasons for doubt."""

from __future__ import annotations

import cv2
import numpy as np
from scenewright.stages.tableware.vision.detections import Detection
from scenewright.stages.tableware.vision.height_map import HeightMap
from scenewright.stages.tableware.vision.rim_finding import Rim
from scenewright.stages.tableware.vision.stack_reading import LIP_TOLERANCE, Stack

LEAST_DEPTH, MOST_GLARE = 0.45, 0.10
"""Shares of a lip's pixels with depth, and of a dish's pixels at full white, at which there is doubt."""
FULL_SUPPORT = 0.65
"""Share of a lip's directions from which more adds nothing."""
WEAK_SUPPORT, WEAK_DEPTH = 0.2, 0.3
"""What a lip without support or without depth loses of its confidence: so little because on tuning tables (seeds 0 to
59 a tier) those with least of both were dishes, all of them."""


def cover_stack(covered: np.ndarray, heights: HeightMap, stack: Stack, label: int) -> None:
    """Write a label where dishes are seen, in place: discs of their outer radius at several heights."""
    for measures, foot in zip(stack.measures, stack.feet, strict=True):
        for share in (0.0, 0.25, 0.5, 0.75, 1.0):
            z = foot + share * measures.height
            u, v = heights.pixel(np.float64(stack.x), np.float64(stack.y), z)
            radius = float(heights.scale(z)) * measures.outer_radius(share * measures.height) + 2.0
            cv2.circle(covered, (int(round(float(u))), int(round(float(v)))), int(round(radius)), label, -1)


def dishes_of(stack: Stack, heights: HeightMap, crossed: set[int], first: int) -> list[Detection]:
    """Return the dishes of a stack from the lowest up; those under one of their own kind are hidden."""
    result = []
    rims = {rim.kind: rim for rim in stack.rims}
    for level, (kind, foot) in enumerate(zip(stack.kinds, stack.feet, strict=True)):
        rim = rims[kind]
        hidden = level + 1 < len(stack.kinds) and stack.kinds[level + 1] == kind
        confidence, reasons = _doubt(rim, stack, heights)
        if id(rim) in crossed:
            confidence, reasons = 0.5 * confidence, (*reasons, "overlapping rims")
        at = (stack.x, stack.y) if hidden else (rim.x, rim.y)
        result.append(
            Detection(
                kind=kind,
                position=(*at, foot),
                lip=foot + stack.measures[level].height,
                hidden=hidden,
                on=first + level - 1 if level else None,
                confidence=confidence,
                unsure=reasons,
            )
        )
    return result


def _doubt(rim: Rim, stack: Stack, heights: HeightMap) -> tuple[float, tuple[str, ...]]:
    """Return the confidence 0..1 in a rim and the reasons for doubt."""
    reasons = []
    confidence = 1.0 - WEAK_SUPPORT * (1.0 - min(1.0, rim.support / FULL_SUPPORT))
    confidence *= float(np.exp(-0.5 * (max(0.0, stack.misfit - 0.5 * LIP_TOLERANCE) / LIP_TOLERANCE) ** 2))
    if rim.depth_share < LEAST_DEPTH:
        reasons.append("no depth")
        confidence *= 1.0 - WEAK_DEPTH * (1.0 - rim.depth_share / LEAST_DEPTH)
    if stack.misfit > LIP_TOLERANCE:
        reasons.append("a stack of unknown height")
    u, v = (float(value) for value in heights.pixel(np.float64(rim.x), np.float64(rim.y), rim.lip))
    radius = 0.7 * stack.measures[stack.kinds.index(rim.kind)].rim_radius * float(heights.scale(rim.lip))
    part = heights.color[max(0, int(v - radius)) : int(v + radius) + 1, max(0, int(u - radius)) : int(u + radius) + 1]
    bright = part.min(axis=2) if part.size else np.zeros((1, 1))
    if float((bright >= 253).mean()) > MOST_GLARE and float(np.median(bright)) < 250:
        reasons.append("glare")
        confidence *= 0.7
    return confidence, tuple(reasons)
