"""The image with what was found: outlines at the height of the lip, full lines where sure, dashed where there is doubt,
each with its kind and confidence; below it the statement."""

from __future__ import annotations

import textwrap

import cv2
import numpy as np
from scenewright.stages.tableware.vision.detections import Detection
from scenewright.stages.tableware.vision.photographs import Outline
from scenewright.stages.tableware.vision.seeing import Sight
from scenewright.stages.tableware.world.items import DishSizes

COLORS = {
    "cup": (235, 70, 60),
    "bowl": (40, 180, 70),
    "plate": (60, 120, 240),
    "fork": (245, 160, 30),
    "spoon": (20, 190, 200),
    None: (220, 60, 220),
}
"""sRGB by kind; None is unknown."""
SURE = 0.9
"""Confidence from which on an outline is drawn full; by eye."""
FONT, LINE = cv2.FONT_HERSHEY_SIMPLEX, 20
"""Font of the labels, and height of a line of text [px]."""
HALO = ((-1, 0), (1, 0), (0, -1), (0, 1))
"""Offsets [px] of a label's dark edge."""


def draw_sight(color: np.ndarray, sight: Sight) -> np.ndarray:
    """Return the image (H, W, 3) uint8 as it was given with the detections of a sight, and its statement below."""
    picture = np.ascontiguousarray(color).copy()
    camera_from_world = np.linalg.inv(sight.world_from_camera)
    labels: list[tuple[tuple[int, int], str, tuple[int, int, int]]] = []
    for number, detection in enumerate(sight.detections):
        points = _project(_outline(detection, sight.sizes), camera_from_world, sight)
        if points is None:
            continue
        tone = COLORS[detection.kind]
        sure = detection.kind is not None and not detection.unsure and detection.confidence >= SURE
        _line(picture, points, tone, dashed=not sure, thin=detection.hidden)
        if detection.kind in ("fork", "spoon"):
            cv2.circle(picture, (int(points[-1, 0]), int(points[-1, 1])), 4, tone, -1, cv2.LINE_AA)
        name = detection.kind or "unknown"
        label = f"{number} {name} {detection.confidence:.2f}" if detection.kind else f"{number} {name}"
        middle = points.mean(axis=0) if detection.kind in ("fork", "spoon") else points[np.argmin(points[:, 1])]
        labels.append(((int(middle[0]), int(middle[1])), label, tone))
    _write(picture, labels)
    return _with_text(picture, sight.statement)


def draw_outlines(color: np.ndarray, outlines: tuple[Outline, ...], statement: str) -> np.ndarray:
    """Return a photograph (H, W, 3) uint8 with its outlines' boxes, and the statement below."""
    picture = np.ascontiguousarray(color).copy()
    labels = []
    for number, outline in enumerate(outlines):
        left, top, right, bottom = (int(round(value)) for value in outline.box)
        corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom], [left, top]], dtype=float)
        _line(picture, corners, COLORS[outline.kind], dashed=True, thin=False)
        labels.append(
            ((left, top), f"{number} {outline.kind or 'round'} {outline.confidence:.2f}", COLORS[outline.kind])
        )
    _write(picture, labels)
    return _with_text(picture, statement)


def _outline(detection: Detection, sizes: DishSizes) -> np.ndarray:
    """Return world points (N, 3) [m] of a detection's outline at the height of its lip."""
    x, y, _ = detection.position
    if detection.kind in ("fork", "spoon"):
        half = 0.5 * sizes[detection.kind].length
        along = np.linspace(-half, half, 24)
        return np.column_stack(
            [x + along * np.cos(detection.yaw), y + along * np.sin(detection.yaw), np.full(24, detection.lip)]
        )
    radius = detection.extent if detection.kind is None else (detection.size or sizes[detection.kind]).rim_radius
    angles = np.linspace(0.0, 2.0 * np.pi, 73)
    return np.column_stack([x + radius * np.cos(angles), y + radius * np.sin(angles), np.full(73, detection.lip)])


def _project(points: np.ndarray, camera_from_world: np.ndarray, sight: Sight) -> np.ndarray | None:
    """Return (N, 2) pixels, or None when a point is not in front of the camera."""
    in_camera = points @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
    if (in_camera[:, 2] < 0.05).any():
        return None
    camera = sight.camera
    return np.column_stack(
        [
            camera.fx * in_camera[:, 0] / in_camera[:, 2] + camera.cx,
            camera.fy * in_camera[:, 1] / in_camera[:, 2] + camera.cy,
        ]
    )


def _line(picture: np.ndarray, points: np.ndarray, tone: tuple[int, int, int], dashed: bool, thin: bool) -> None:
    """Draw a line through points (N, 2), in place; dashes are six pixels and gaps as long."""
    width = 1 if thin else 2
    steps = np.hypot(*np.diff(points, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    if not dashed:
        cv2.polylines(picture, [np.rint(points).astype(np.int32)], False, tone, width, cv2.LINE_AA)
        return
    for start in np.arange(0.0, along[-1], 12.0):
        ends = [
            [np.interp(at, along, points[:, axis]) for axis in (0, 1)] for at in (start, min(start + 6.0, along[-1]))
        ]
        first, last = (tuple(int(round(value)) for value in end) for end in ends)
        cv2.line(picture, first, last, tone, width, cv2.LINE_AA)


def _write(picture: np.ndarray, labels: list[tuple[tuple[int, int], str, tuple[int, int, int]]]) -> None:
    """Write labels, in place, each moved down until it is on no other."""
    spans: list[tuple[int, int, int]] = []
    for (u, v), text, tone in labels:
        (width, _), _ = cv2.getTextSize(text, FONT, 0.42, 1)
        left = int(np.clip(u - width // 2, 2, max(2, picture.shape[1] - width - 2)))
        v = max(14, v - 5)
        while any(abs(v - row) < 14 and left < right and start < left + width for start, right, row in spans):
            v += 14
        spans.append((left, left + width, v))
        for du, dv in HALO:  # a thicker text is a wider one, it would not lie behind
            cv2.putText(picture, text, (left + du, v + dv), FONT, 0.42, (0, 0, 0), 1, cv2.LINE_AA)
        cv2.putText(picture, text, (left, v), FONT, 0.42, tuple(min(255, c + 60) for c in tone), 1, cv2.LINE_AA)


def _with_text(picture: np.ndarray, text: str) -> np.ndarray:
    lines = textwrap.wrap(
        text + ". Full lines: sure; dashed: in doubt; thin: hidden in a stack.", max(20, picture.shape[1] // 8)
    )
    foot = np.full((LINE * len(lines) + 10, picture.shape[1], 3), 255, dtype=np.uint8)
    for number, line in enumerate(lines):
        cv2.putText(foot, line, (6, LINE * (number + 1) - 3), FONT, 0.45, (20, 20, 20), 1, cv2.LINE_AA)
    return np.vstack([picture, foot])
