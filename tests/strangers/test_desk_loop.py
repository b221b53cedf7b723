"""The recorded desk, without poses, calibration or stamps of a clock, by what `inspect` prints to a closed loop."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import cv2
import numpy as np
import pytest
from scenewright.stages.kit.formats.trajectories import read_tum
from scenewright.stages.kit.geometry.transforms import inverse, transform_from
from scenewright.stages.kit.registration.rigid_motion import between, distance_of

from tests.real_data import real_data
from tests.strangers.calls import call

EARLY, LATE = 5, 176
"""Pictures of one place, out and back. Neither is a key frame, so that no loop of ours joins the two."""


@pytest.mark.slow
def test_the_way_from_inspect_to_a_closed_loop(tmp_path: Path) -> None:
    """Each command is that which the one before printed; SIFT and depth of two pictures alone are the witness."""
    log = real_data("realsense_desk_noposes")
    said = call("inspect", log)
    intrinsics = re.search(r"RealSense D435 are about ((?:--\w\w \d+ ?)+)", said.err)
    assert said.code == 3 and intrinsics is not None, said.err
    looked = call("inspect", log, *intrinsics[1].split(), "--quiet")
    assert looked.code == 0 and "--frame-rate" in looked.out and "--depth-scale" in looked.out
    (line,) = [line for line in looked.out.splitlines() if line.startswith("run it")]
    words = shlex.split(line.removeprefix("run it"))
    words = words[words.index("run") : words.index("--out")]
    made = call(*words, "--only", "sequence", "--only", "trajectory", "--out", tmp_path / "run", "--quiet")
    assert made.code == 0, made.err
    times, poses = read_tum(tmp_path / "run" / "trajectory" / "trajectory.tum")
    assert len(times) == 65
    own = between(poses[(EARLY - 2) // 3], poses[(LATE - 2) // 3])
    there, back = placed(log, EARLY, LATE), placed(log, LATE, EARLY)
    assert distance_of(there @ back) < 0.005, "the witness agrees with itself"
    for witness in (there, inverse(back)):
        assert distance_of(inverse(witness) @ own) < 0.015


def placed(log: Path, first: int, second: int) -> np.ndarray:
    """Return first_from_second (4, 4) of two pictures by SIFT, the depth of the second, and PnP."""
    found = []
    for number in (first, second):
        picture = cv2.imread(str(log / f"rgb/rgb{number:05d}.jpg"), cv2.IMREAD_GRAYSCALE)
        found.append(cv2.SIFT.create(3000).detectAndCompute(picture, None))
    (here, words), (there, other_words) = found
    pairs = cv2.BFMatcher().knnMatch(words, other_words, k=2)
    pairs = [near for near, second_best in pairs if near.distance < 0.75 * second_best.distance]
    pixels = np.array([here[pair.queryIdx].pt for pair in pairs])
    others = np.array([there[pair.trainIdx].pt for pair in pairs])
    depth = cv2.imread(str(log / f"depths/depth{second:05d}.png"), cv2.IMREAD_UNCHANGED)
    assert depth is not None
    column, row = np.rint(others).astype(int).T
    z = depth[row, column] / 1000
    points = np.column_stack([(others[:, 0] - 320) / 615 * z, (others[:, 1] - 240) / 615 * z, z])
    near = (z > 0) & (z < 4.5)
    matrix = np.array([[615.0, 0, 320], [0, 615, 240], [0, 0, 1]])
    cv2.setRNGSeed(0)
    _, turn, shift, inliers = cv2.solvePnPRansac(
        points[near], pixels[near], matrix, None, iterationsCount=2000, reprojectionError=2.0, confidence=0.9999
    )
    assert inliers is not None and len(inliers) >= 30
    best = inliers[:, 0]
    turn, shift = cv2.solvePnPRefineLM(points[near][best], pixels[near][best], matrix, None, turn, shift)
    return transform_from(cv2.Rodrigues(turn)[0], shift[:, 0])
