"""Takes the README's pictures out of a finished demo run: python docs/pictures.py outputs/demo (make pictures)."""

from __future__ import annotations

import base64
import re
import sys
from pathlib import Path

import cv2
import numpy as np

WANTED = {
    "frame 30": "frame.jpg",
    "segments of frame 30": "segments.jpg",
    "The map, every instance in its colour": "map.jpg",
    "CAD scene": "cad_scene.jpg",
    "contact graphs": "graphs.png",
}
"""Alternative text of a picture in report.html -> file in docs/images."""


def pictures_of(html: str) -> dict[str, bytes]:
    """Return alternative text -> image bytes; the first of several with the same text."""
    found: dict[str, bytes] = {}
    for tag in re.findall(r"<img[^>]*>", html):
        text, data = re.search(r'alt="([^"]*)"', tag), re.search(r'src="data:image/\w+;base64,([^"]+)"', tag)
        if text and data:
            found.setdefault(text[1], base64.b64decode(data[1]))
    return found


def film_strip(key_frames: list[Path], columns: int = 4) -> np.ndarray:
    """Return key frames side by side in rows, (H, W, 3) BGR, small enough for a README."""
    images = [cv2.resize(cv2.imread(str(path)), (320, 240), interpolation=cv2.INTER_AREA) for path in key_frames]
    images += [np.full_like(images[0], 255)] * (-len(images) % columns)
    return np.vstack([np.hstack(images[i : i + columns]) for i in range(0, len(images), columns)])


def main(run: Path) -> None:
    """Write docs/images from a run folder."""
    folder = Path(__file__).resolve().parent / "images"
    pictures = pictures_of((run / "report" / "report.html").read_text())
    for text, name in WANTED.items():
        (folder / name).write_bytes(pictures[text])
    key_frames = sorted((run / "plan" / "keyframes").glob("*.png"))
    chosen = [key_frames[i] for i in np.linspace(0, len(key_frames) - 1, 8).round().astype(int)]
    cv2.imwrite(str(folder / "robot.jpg"), film_strip(chosen), [cv2.IMWRITE_JPEG_QUALITY, 88])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
