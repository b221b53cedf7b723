"""Pairs of pictures kept on disk: both eyes as PNG, the left disparity in 64ths of a pixel.

Names are `room_*`, `needle_*` and `endoscope_*`, each with `_left.png`, `_right.png`, `_disparity.png`, `_bodies.png`.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput

FRACTION = 64.0
"""Disparities are kept in so many parts of a pixel, as 16-bit numbers; 0 is unknown."""
NEEDLE = 1
"""The needle's number among the bodies."""


@dataclass(frozen=True)
class KeptPair:
    """A pair with its truth."""

    left: np.ndarray
    """(H, W, 3) uint8 RGB."""
    right: np.ndarray
    disparity: np.ndarray
    """(H, W) float32 [px], NaN unknown."""
    bodies: np.ndarray
    """(H, W) uint8: the needle world's bodies; zero in rooms."""


def keep(stem: Path, pair: KeptPair) -> None:
    """Write a pair; the left picture last, as it is looked for."""
    stem.parent.mkdir(parents=True, exist_ok=True)
    disparity = pair.disparity
    fixed = np.where(np.isfinite(disparity) & (disparity > 0), np.rint(FRACTION * np.nan_to_num(disparity)), 0)
    _write(kept_file(stem, "disparity"), np.clip(fixed, 0, 65535).astype(np.uint16))
    _write(kept_file(stem, "bodies"), pair.bodies)
    _write(kept_file(stem, "right"), pair.right[..., ::-1])
    _write(kept_file(stem, "left"), pair.left[..., ::-1])


def kept(stem: Path) -> KeptPair:
    """Read a pair. Raises BadInput for a damaged one."""
    left, right = (cv2.imread(str(kept_file(stem, eye)), cv2.IMREAD_COLOR) for eye in ("left", "right"))
    fixed, bodies = (cv2.imread(str(kept_file(stem, what)), cv2.IMREAD_UNCHANGED) for what in ("disparity", "bodies"))
    if left is None or right is None or fixed is None or bodies is None:
        raise BadInput(f"{stem}: the kept pair cannot be read", hint="delete its files; it will be made again")
    disparity = np.where(fixed > 0, fixed / np.float32(FRACTION), np.nan).astype(np.float32)
    return KeptPair(left[..., ::-1].copy(), right[..., ::-1].copy(), disparity, bodies)


def stems(folder: Path, *kinds: str) -> list[Path]:
    """Return the stems of the kept pairs of these kinds in their order. Raises BadInput where there is none."""
    found = [file for kind in kinds for file in sorted(folder.glob(f"{kind}_*_left.png"))]
    if not found:
        raise BadInput(f"{folder}: no kept pairs of {' or '.join(kinds)}", hint="render them first: docs/MAPPING.md")
    return [file.with_name(file.name.removesuffix("_left.png")) for file in found]


def is_kept(stem: Path) -> bool:
    """Whether the pair of this stem is there, whole."""
    return kept_file(stem, "left").is_file()


def kept_file(stem: Path, what: str) -> Path:
    """Return the picture of a pair: `left`, `right`, `disparity` or `bodies`."""
    return stem.with_name(f"{stem.name}_{what}.png")


def _write(path: Path, picture: np.ndarray) -> None:
    half = path.with_name("half_" + path.name)
    cv2.imwrite(str(half), picture)
    os.replace(half, path)
