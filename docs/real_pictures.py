"""Map and CAD scene of the real logs side by side: python docs/real_pictures.py outputs/experiments/real."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
from pictures import pictures_of

LOGS = ("kitchen", "livingroom")
SIDES = ("In the colours of the images", "CAD scene")
SIZE = (640, 396)


def pair(report: Path) -> np.ndarray:
    """Return map and scene of one report side by side, (H, W, 3) BGR."""
    pictures = pictures_of(report.read_text())
    images = [cv2.imdecode(np.frombuffer(pictures[side], np.uint8), cv2.IMREAD_COLOR) for side in SIDES]
    return np.hstack([cv2.resize(image, SIZE, interpolation=cv2.INTER_AREA) for image in images])


def main(runs: Path) -> None:
    """Write docs/images/real_scenes.jpg from the runs of `make real`."""
    target = Path(__file__).resolve().parent / "images" / "real_scenes.jpg"
    rows = np.vstack([pair(runs / log / "report" / "report.html") for log in LOGS])
    cv2.imwrite(str(target), rows, [cv2.IMWRITE_JPEG_QUALITY, 88])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
