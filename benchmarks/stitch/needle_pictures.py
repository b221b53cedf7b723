"""Pictures of rendered views: both eyes about the needle, the mask's outline, the truth, ours with its uncertainty.

    python -m benchmarks.stitch.needle_pictures --out FILE.png [--seeds N ...]

Truth is green, our estimate yellow (red where it abstained) with the tip marked by a ring and the 95 % ellipses of
both ends; the mask's outline is white. By default tuning seeds.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

from benchmarks.stitch.needle_trials import CASES, observe
from stages.suture.needle.drawing import draw_eyes
from stages.suture.needle.estimate import estimate
from stages.suture.world.render import render
from stages.suture.world.sampling import seen_scene


def main() -> None:
    """Parse the command line and draw."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stitch.needle_pictures", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, nargs="+", default=[3, 7, 248, 440])
    options = parser.parse_args()
    case = CASES["rendered"]
    rows = []
    for seed in options.seeds:
        scene, _ = seen_scene(seed, case.rig, calibration_error=case.calibration_error)
        view = render(scene)
        observation = observe(view, case.disparity_noise, seed)
        assert view.left.image is not None and view.right.image is not None
        masks = observation.left_mask, observation.right_mask
        answer = estimate(observation)
        rows.append(draw_eyes((view.left.image, view.right.image), masks, view.rig, answer, view.pose))
    options.out.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(options.out), np.vstack(rows)[..., ::-1])
    print(options.out)


if __name__ == "__main__":
    main()
