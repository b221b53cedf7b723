"""Outlines as others write them: polygons, ellipses, rectangles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput

BEYOND = 1.0
"""How far an outline may reach over a picture whose size nobody says [pixels]."""
CORNERS = 64
"""Corners of a circle or an ellipse."""


def polygons_of(outline: Any) -> list[np.ndarray]:
    """Return the polygons (K, 2) of a COCO segmentation: a list of lists x1, y1, x2, y2, ...; one such list, and a list
    of points, are taken for one polygon. What has fewer than three corners encloses nothing and is left out.

    Raises BadInput, in words that follow the name of the mask, when it is no list of numbers in pairs.
    """
    if not isinstance(outline, list):
        raise BadInput("its outline is not a list of polygons", hint="[[x1, y1, x2, y2, x3, y3, ...], ...]")
    if outline and all(_is_number(value) for value in outline):
        outline = [outline]
    if len(outline) > 2 and all(isinstance(part, list) and len(part) == 2 for part in outline):
        outline = [[value for part in outline for value in part]]
    polygons = []
    for part in outline:
        if not isinstance(part, list) or len(part) % 2 or not all(_is_number(value) for value in part):
            raise BadInput(
                "one of its polygons is not a list of numbers in pairs", hint="[[x1, y1, x2, y2, x3, y3, ...], ...]"
            )
        if len(part) >= 6:
            polygons.append(np.array(part, dtype=np.float64).reshape(-1, 2))
    return polygons


def ellipse(center: tuple[float, float], radii: tuple[float, float], turn: float = 0.0) -> np.ndarray:
    """Return a polygon (CORNERS, 2) for an ellipse turned by `turn` [rad] from x to y."""
    angle = np.arange(CORNERS) * (2 * np.pi / CORNERS)
    points = np.stack([radii[0] * np.cos(angle), radii[1] * np.sin(angle)], axis=1)
    return turned(points + center, center, turn)


def rectangle(corner: tuple[float, float], size: tuple[float, float], turn: float = 0.0) -> np.ndarray:
    """Return a polygon (4, 2) for a rectangle turned by `turn` [rad] about its corner."""
    (x, y), (wide, high) = corner, size
    return turned(np.array([[x, y], [x + wide, y], [x + wide, y + high], [x, y + high]]), corner, turn)


def turned(points: np.ndarray, about: tuple[float, float], turn: float) -> np.ndarray:
    """Return points (K, 2) turned by `turn` [rad] from x to y."""
    c, s = np.cos(turn), np.sin(turn)
    return (points - about) @ np.array([[c, s], [-s, c]]) + about


def check_size(size: tuple[int, int] | None, polygons: Sequence[np.ndarray], shape: tuple[int, int]) -> None:
    """Raise BadInput when polygons are of pictures of another `size` (width, height) than a frame of `shape` (H, W);
    None: nobody says it, and they must not reach over the frame."""
    hint = "outlines have the size of the sequence's pictures; scale them"
    if size is not None and size != (shape[1], shape[0]):
        raise BadInput(
            f"its outline is of a picture of {size[0]}x{size[1]}, the frame has {shape[1]}x{shape[0]} pixels", hint=hint
        )
    if size is None and polygons:
        reach = np.concatenate(polygons).max(axis=0)
        if reach[0] > shape[1] + BEYOND or reach[1] > shape[0] + BEYOND:
            raise BadInput(
                f"its outline reaches to ({reach[0]:.0f}, {reach[1]:.0f}), the frame has {shape[1]}x{shape[0]} pixels",
                hint=hint,
            )


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e9
