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
from stages.suture.needle.estimate import estimate
from stages.suture.needle.observation import NeedleEstimate, NeedleObservation
from stages.suture.rig import NeedlePose, StereoRig
from stages.suture.world.render import StereoView, render
from stages.suture.world.sampling import seen_scene

SCALE, HALF_WIDTH, HALF_HEIGHT = 4, 90, 75
GREEN, YELLOW, RED, WHITE = (80, 220, 80), (250, 220, 40), (250, 60, 40), (255, 255, 255)
CHI_95 = 5.99


def main() -> None:
    """Parse the command line and draw."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stitch.needle_pictures", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, nargs="+", default=[3, 7, 13, 15])
    options = parser.parse_args()
    case = CASES["rendered"]
    rows = []
    for seed in options.seeds:
        scene, _ = seen_scene(seed, case.rig, calibration_error=case.calibration_error)
        view = render(scene)
        observation = observe(view, case.disparity_noise, seed)
        rows.append(_row(view, observation, estimate(observation)))
    options.out.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(options.out), np.vstack(rows)[..., ::-1])
    print(options.out)


def _row(view: StereoView, observation: NeedleObservation, answer: NeedleEstimate) -> np.ndarray:
    """Return the left eye's and the right eye's cut-out side by side, (h, w, 3) RGB."""
    panels = []
    for eye in (0, 1):
        image = (view.right if eye else view.left).image
        mask = observation.right_mask if eye else observation.left_mask
        assert image is not None
        middle = _pixels(view.rig, view.pose, np.linspace(0.0, np.pi, 9), eye).mean(axis=0)
        corner = np.clip(np.round(middle).astype(int) - [HALF_WIDTH, HALF_HEIGHT], 0, None)
        corner = np.minimum(corner, [view.rig.width - 2 * HALF_WIDTH, view.rig.height - 2 * HALF_HEIGHT])
        window = np.s_[corner[1] : corner[1] + 2 * HALF_HEIGHT, corner[0] : corner[0] + 2 * HALF_WIDTH]
        panel = cv2.resize(image[window], None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_LINEAR)
        large = cv2.resize(mask[window].astype(np.uint8), None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_NEAREST)
        cv2.drawContours(panel, cv2.findContours(large, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0], -1, WHITE, 1)
        _draw_pose(panel, view.rig, view.pose, corner, eye, GREEN)
        if answer.pose is not None:
            colour = RED if answer.abstained else YELLOW
            _draw_pose(panel, view.rig, answer.pose, corner, eye, colour)
            for angle in (0.0, np.pi):
                _draw_ellipse(panel, view.rig, answer, angle, corner, eye, colour)
        panels.append(panel)
    return np.hstack(panels)


def _pixels(rig: StereoRig, pose: NeedlePose, angles: np.ndarray, eye: int) -> np.ndarray:
    points = pose.points(angles)
    return rig.right(points) if eye else rig.left(points)


def _draw_pose(
    panel: np.ndarray, rig: StereoRig, pose: NeedlePose, corner: np.ndarray, eye: int, colour: tuple[int, int, int]
) -> None:
    """Draw the arc, and a ring about its tip."""
    pixels = (_pixels(rig, pose, np.linspace(0.0, np.pi, 90), eye) - corner + 0.5) * SCALE
    points = np.round(pixels).astype(np.int32)
    cv2.polylines(panel, [points.reshape(-1, 1, 2)], False, colour, 1, cv2.LINE_AA)
    cv2.circle(panel, (int(points[0, 0]), int(points[0, 1])), 9, colour, 1, cv2.LINE_AA)


def _draw_ellipse(
    panel: np.ndarray,
    rig: StereoRig,
    answer: NeedleEstimate,
    angle: float,
    corner: np.ndarray,
    eye: int,
    colour: tuple[int, int, int],
) -> None:
    """Draw the 95 % ellipse of where the estimate says that the end at arc `angle` is seen."""
    assert answer.pose is not None
    point = answer.pose.points(np.array([angle]))[0]
    arm = point - answer.pose.centre
    turn = np.array([[0.0, arm[2], -arm[1]], [-arm[2], 0.0, arm[0]], [arm[1], -arm[0], 0.0]])
    of_point = np.hstack([np.eye(3), turn])
    step = 1e-5
    moved = np.vstack([point, point + step * np.eye(3)])
    pixels = rig.right(moved) if eye else rig.left(moved)
    jacobian = (pixels[1:] - pixels[0]).T / step
    covariance = jacobian @ of_point @ answer.covariance @ of_point.T @ jacobian.T
    values, vectors = np.linalg.eigh(covariance)
    axes = np.sqrt(np.maximum(values, 1e-6) * CHI_95) * SCALE
    centre = (pixels[0] - corner + 0.5) * SCALE
    degrees = float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))
    size = (max(int(axes[1]), 1), max(int(axes[0]), 1))
    cv2.ellipse(panel, (int(centre[0]), int(centre[1])), size, degrees, 0, 360, colour, 1, cv2.LINE_AA)


if __name__ == "__main__":
    main()
