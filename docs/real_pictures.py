"""Pictures of the real logs: python docs/real_pictures.py RUNS outputs/experiments/real-plan.

Map and CAD scene side by side, of RUNS/kitchen and RUNS/livingroom, which `scenewright run reconstruct` wrote with the
detector; the robot in the kitchen's scene after `make real-plan`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
from pictures import in_a_row, pictures_of

LOGS = ("kitchen", "livingroom")
SIDES = ("In the colours of the images", "CAD scene")
SIZE = (640, 396)
PLAN = Path("trials", "ours", "cup_white", "1000", "plan", "keyframes")
MOMENTS = ("02_grasp", "03_pick", "05_release", "06_place")


def pair(report: Path) -> np.ndarray:
    """Return map and scene of one report side by side, (H, W, 3) BGR."""
    pictures = pictures_of(report.read_text())
    return np.hstack([cv2.resize(pictures[side], SIZE, interpolation=cv2.INTER_AREA) for side in SIDES])


def main(runs: Path, plans: Path) -> None:
    """Write docs/images/real_scenes.jpg from the reports of runs, real_plan.jpg from those of `make real-plan`."""
    images = Path(__file__).resolve().parent / "images"
    rows = np.vstack([pair(runs / log / "report" / "report.html") for log in LOGS])
    cv2.imwrite(str(images / "real_scenes.jpg"), rows, [cv2.IMWRITE_JPEG_QUALITY, 88])
    shown = [cv2.imread(str(plans / PLAN / f"{name}.png")) for name in MOMENTS]
    cv2.imwrite(str(images / "real_plan.jpg"), in_a_row(shown), [cv2.IMWRITE_JPEG_QUALITY, 88])


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
