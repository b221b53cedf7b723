"""Tableware in one overhead RGB-D image: dishes and stacks from depth, utensils from colour and depth.

    detections = detect(color, depth, overhead_camera())

Dishes are found by their lips, whose heights say how many stand in one another; utensils on dishes lie at a lip's
height, utensils on the table differ from it in colour and rise over it by their thickness. What is left over and stands
out is reported as unknown. Every item has a confidence and the reasons for doubt.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from scenewright.stages.tableware.vision.detections import Detection
from scenewright.stages.tableware.vision.dish_reading import cover_stack, dishes_of
from scenewright.stages.tableware.vision.foreground import rising, unlike_table
from scenewright.stages.tableware.vision.height_map import TALLEST, HeightMap, height_map
from scenewright.stages.tableware.vision.rim_finding import find_rims, overlapping
from scenewright.stages.tableware.vision.stack_reading import read_stacks
from scenewright.stages.tableware.vision.utensil_finding import Bar
from scenewright.stages.tableware.vision.utensil_reading import (
    SAME_PLACE,
    UNKNOWN_AREA,
    as_detection,
    utensils_on_dish,
    utensils_on_table,
)
from scenewright.stages.tableware.world.items import STANDARD, TABLE_SIDES, UTENSILS, DishSizes
from scenewright.stages.tableware.world.overhead import OverheadCamera

UNKNOWN_HEIGHT = 0.010
"""What rises over this [m] on more than UNKNOWN_AREA without being an item is unknown."""


def detect(
    color: np.ndarray,
    depth: np.ndarray,
    camera: OverheadCamera,
    sides: tuple[float, float] = TABLE_SIDES,
    sizes: DishSizes = STANDARD,
) -> tuple[Detection, ...]:
    """Return the items in an image; what carries another comes before it.

    `color` (H, W, 3) uint8, `depth` (H, W) z-depth [m], 0 where unknown; `sides` of the workspace along x and y [m],
    `sizes` of what is looked for. An
    empty table gives an empty tuple. Raises BadInput when there is no depth, its scale is wrong, or the images do not
    fit the camera.
    """
    return items_in(height_map(color, depth, camera, sides), sizes)


def items_in(heights: HeightMap, sizes: DishSizes) -> tuple[Detection, ...]:
    """Return the items in a map of heights, as `detect` does."""
    rims = find_rims(heights, sizes)
    crossed = {id(rims[index]) for index in overlapping(rims, sizes)}
    stacks = read_stacks(rims, sizes)
    covered = np.zeros(heights.smooth.shape, dtype=np.uint8)
    for index, stack in enumerate(stacks):
        cover_stack(covered, heights, stack, index + 1)
    detections: list[Detection] = []
    for index, stack in enumerate(stacks):
        carrier = len(detections) + len(stack.kinds) - 1
        detections.extend(dishes_of(stack, heights, crossed, len(detections)))
        for level, utensil in enumerate(utensils_on_dish(heights, stack, covered, index + 1, sizes)):
            z = stack.top + level * sizes[utensil.bar.kind].height
            detections.append(as_detection(utensil, heights, z, carrier, sizes))
            carrier = len(detections) - 1
            _cover_bar(covered, heights, utensil.bar, z, sizes)
    hidden = covered > 0
    around_covered = cv2.dilate(covered, np.ones((5, 5), np.uint8)) > 0
    unlike = rising(heights, unlike_table(heights, around_covered), around_covered) & heights.workspace()
    lying, strange = utensils_on_table(heights, unlike, hidden, sizes)
    for utensil in lying:
        middle = np.array(heights.world(np.float64(utensil.bar.u), np.float64(utensil.bar.v), 0.0))
        below = [
            k
            for k, detected in enumerate(detections)
            if detected.on is None
            and detected.kind in UTENSILS
            and np.hypot(*(middle - detected.position[:2])) < SAME_PLACE
        ]
        z = sizes[utensil.bar.kind].height if below else 0.0
        detections.append(as_detection(utensil, heights, z, below[0] if below else None, sizes))
        _cover_bar(covered, heights, utensil.bar, z, sizes)
    detections.extend(_unknown(heights, covered, strange))
    return tuple(_outside(detection, heights.sides, sizes) for detection in detections)


def _cover_bar(covered: np.ndarray, heights: HeightMap, bar: Bar, z: float, sizes: DishSizes) -> None:
    half = 0.5 * sizes[bar.kind].length * float(heights.scale(z))
    dx, dy = half * np.cos(bar.angle), half * np.sin(bar.angle)
    ends = [(int(round(bar.u + s * dx)), int(round(bar.v + s * dy))) for s in (-1.0, 1.0)]
    cv2.line(covered, ends[0], ends[1], 255, int(1.5 * sizes[bar.kind].width * float(heights.scale(z))))


def _unknown(heights: HeightMap, covered: np.ndarray, strange: np.ndarray) -> list[Detection]:
    """Return what stands out and is no item that was found."""
    high = ((heights.smooth > max(UNKNOWN_HEIGHT, 4.0 * heights.roughness)) | heights.tall) & heights.workspace()
    high = cv2.morphologyEx((high & (covered == 0)).astype(np.uint8), cv2.MORPH_OPEN, np.ones((5, 5), np.uint8))
    high = np.asarray(high, dtype=np.uint8) | strange.astype(np.uint8)
    if not high.any():
        return []
    high[cv2.dilate(covered, np.ones((13, 13), np.uint8)) > 0] = 0
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(high, ltype=cv2.CV_16U)
    result = []
    for label in range(1, count):
        left, top, width, height, area = boxes[label]
        inside = labels[top : top + height, left : left + width] == label
        tall = float(np.percentile(heights.smooth[top : top + height, left : left + width][inside], 90))
        reason = "unknown object"
        if heights.tall[top : top + height, left : left + width][inside].any():
            tall, reason = TALLEST, f"taller than {TALLEST:.2f} m"
        scale = float(heights.scale(max(0.0, tall)))
        if area < UNKNOWN_AREA * scale**2:
            continue
        x, y = heights.world(np.float64(left + 0.5 * width), np.float64(top + 0.5 * height), tall)
        result.append(
            Detection(
                kind=None,
                position=(float(x), float(y), 0.0),
                lip=max(0.0, tall),
                confidence=0.0,
                extent=0.5 * float(np.hypot(width, height)) / scale,
                unsure=(reason,),
            )
        )
    return result


def _outside(detection: Detection, sides: tuple[float, float], sizes: DishSizes) -> Detection:
    """Return a detection with the doubt that its middle, or a dish's rim, is not over the workspace."""
    reach = sizes[detection.kind].rim_radius if detection.kind is not None else 0.0
    over = [abs(detection.position[axis]) + reach - 0.5 * sides[axis] for axis in (0, 1)]
    if max(over) > 0.006:
        return replace(
            detection, unsure=(*detection.unsure, "outside of the workspace"), confidence=0.5 * detection.confidence
        )
    return detection
