"""Pictures of learned masks beside what they are made of: cut-outs about the needle.

    python -m benchmarks.stitch.segmentation_pictures --out FILE.png --views FOLDER [--seeds N ...]

Green: needle found rightly, red: taken for needle, blue: needle missed; yellow: thread found rightly, orange: taken for
thread, cyan: thread missed.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

from benchmarks.stitch.segmentation_views import kept_view, read_eye
from stages.suture.rig import TWO_CAMERAS
from stages.suture.segmentation.checkpoint import BUNDLED
from stages.suture.segmentation.infer import Segmenter
from stages.suture.world.tubes import NEEDLE, THREAD

HALF_WIDTH, HALF_HEIGHT, SCALE, ACROSS = 100, 75, 2, 2
COLOURS = {
    NEEDLE: ((60, 220, 60), (255, 30, 30), (40, 70, 255)),
    THREAD: ((250, 230, 60), (255, 140, 0), (60, 240, 255)),
}


def main() -> None:
    """Parse the command line and draw."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stitch.segmentation_pictures", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--views", type=Path, required=True)
    parser.add_argument("--checkpoint", type=Path, default=BUNDLED)
    parser.add_argument("--seeds", type=int, nargs="+", default=[450, 451, 452, 453, 454, 455])
    options = parser.parse_args()
    segmenter = Segmenter.load(options.checkpoint)
    pairs = [pair(options.views, seed, segmenter) for seed in options.seeds]
    while len(pairs) % ACROSS:
        pairs.append(np.zeros_like(pairs[0]))
    rows = [np.hstack(pairs[index : index + ACROSS]) for index in range(0, len(pairs), ACROSS)]
    cv2.imwrite(str(options.out), np.vstack(rows)[..., ::-1])
    print(options.out)


def pair(folder: Path, seed: int, segmenter: Segmenter) -> np.ndarray:
    """Return the left eye's cut-out about the needle and the same with masks, (h, w, 3) RGB."""
    picture, bodies = read_eye(kept_view(folder, TWO_CAMERAS, seed), "left")
    found = segmenter.masks(picture)
    rows, columns = np.nonzero(bodies == NEEDLE)
    top = int(np.clip(rows.mean() - HALF_HEIGHT, 0, bodies.shape[0] - 2 * HALF_HEIGHT))
    left = int(np.clip(columns.mean() - HALF_WIDTH, 0, bodies.shape[1] - 2 * HALF_WIDTH))
    window = np.s_[top : top + 2 * HALF_HEIGHT, left : left + 2 * HALF_WIDTH]
    plain, painted = picture[window], picture[window].copy()
    for body, mask in ((THREAD, found.thread), (NEEDLE, found.needle)):
        true, seen = bodies[window] == body, mask[window]
        for where, colour in zip((true & seen, seen & ~true, true & ~seen), COLOURS[body], strict=True):
            painted[where] = colour
    both = np.hstack([plain, painted])
    return cv2.resize(both, None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_NEAREST)


if __name__ == "__main__":
    main()
