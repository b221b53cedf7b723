"""Makes the pictures of README and gallery out of a demo run: python docs/pictures.py outputs/demo (make pictures)."""

from __future__ import annotations

import base64
import re
import sys
from pathlib import Path

import cv2
import numpy as np

TOP = ("frame 30", "The map, every instance in its colour", "CAD scene")
"""Alternative texts in report.html of the upper row: what the camera saw, the map, the scene."""
GRAPHS = "contact graphs"
WIDTH, GAP, KEY_FRAMES = 1600, 6, 5
GALLERY = {
    "synthesize": ("The true room from the same place",),
    "ingest": ("frame 30", "depth of frame 30"),
    "segment": ("frame 50", "segments of frame 50"),
    "fuse": ("The map, every instance in its colour", "In the colours of the images"),
    "cad": ("CAD scene", "CAD scene from above"),
    "plan": ("key frame: grasp", "key frame: place"),
    "evaluate": ("surface distance",),
}
"""Step -> alternative texts in report.html of what the gallery shows of it."""


def pictures_of(html: str) -> dict[str, np.ndarray]:
    """Return alternative text -> image, (H, W, 3) BGR; the first of several with the same text."""
    found: dict[str, np.ndarray] = {}
    for tag in re.findall(r"<img[^>]*>", html):
        text, data = re.search(r'alt="([^"]*)"', tag), re.search(r'src="data:image/\w+;base64,([^"]+)"', tag)
        if text and data and text[1] not in found:
            found[text[1]] = cv2.imdecode(np.frombuffer(base64.b64decode(data[1]), np.uint8), cv2.IMREAD_COLOR)
    return found


def in_a_row(images: list[np.ndarray]) -> np.ndarray:
    """Return images side by side, as high as each other and WIDTH pixels wide, (H, WIDTH, 3)."""
    shapes = [image.shape[1] / image.shape[0] for image in images]
    height = round((WIDTH - GAP * (len(images) - 1)) / sum(shapes))
    gap = np.full((height, GAP, 3), 255, np.uint8)
    scaled = [
        cv2.resize(image, (round(height * shape), height), interpolation=cv2.INTER_AREA)
        for image, shape in zip(images, shapes, strict=True)
    ]
    row = np.hstack([part for image in scaled for part in (gap, image)][1:])
    return cv2.resize(row, (WIDTH, height), interpolation=cv2.INTER_AREA)


def main(run: Path) -> None:
    """Write docs/images/demo.jpg, graphs.png and gallery_*.jpg from a run folder."""
    folder = Path(__file__).resolve().parent / "images"
    pictures = pictures_of((run / "report" / "report.html").read_text())
    cv2.imwrite(str(folder / "graphs.png"), pictures[GRAPHS])
    key_frames = sorted((run / "plan" / "keyframes").glob("*.png"))
    chosen = [key_frames[i] for i in np.linspace(0, len(key_frames) - 1, KEY_FRAMES).round().astype(int)]
    rows = [in_a_row([pictures[text] for text in TOP]), in_a_row([cv2.imread(str(path)) for path in chosen])]
    between = np.full((GAP, WIDTH, 3), 255, np.uint8)
    cv2.imwrite(str(folder / "demo.jpg"), np.vstack([rows[0], between, rows[1]]), [cv2.IMWRITE_JPEG_QUALITY, 85])
    write_gallery(folder, pictures)


def write_gallery(folder: Path, pictures: dict[str, np.ndarray]) -> None:
    """Write a picture a step for docs/index.md, half as wide."""
    for step, texts in GALLERY.items():
        row = in_a_row([pictures[text] for text in texts])
        scale = WIDTH // 2 / row.shape[1]
        small = cv2.resize(row, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(folder / f"gallery_{step}.jpg"), small, [cv2.IMWRITE_JPEG_QUALITY, 80])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
