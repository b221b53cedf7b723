"""Real pairs without a needle: what is made of a depth camera's picture, and pairs of other sizes."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from scenewright.stages.suture import StereoRig

from benchmarks.stitch.needleless import BASELINE, DOLLS, RealPair, needleless_pairs


def test_a_depth_camera_gets_a_second_eye(tmp_path: Path) -> None:
    """A wall 1.05 m away is shifted by 525 x 6 mm / (0.15 x 1.05 m) = 20 pixels."""
    folder = tmp_path / "mosd_tabletop" / "learn"
    folder.mkdir(parents=True)
    picture = np.random.default_rng(0).integers(0, 255, (480, 640, 3), np.uint8)
    cv2.imwrite(str(folder / "learn0.color.png"), picture)
    cv2.imwrite(str(folder / "learn0.depth.png"), np.full((480, 640), 10500, np.uint16))
    pairs = needleless_pairs(tmp_path, tmp_path / "work")
    assert list(pairs) == ["table 0"]
    pair = pairs["table 0"]()
    shift = 525 * BASELINE / (DOLLS * 1.05)
    assert shift == pytest.approx(20.0)
    np.testing.assert_array_equal(pair.left, picture[..., ::-1])
    np.testing.assert_array_equal(pair.right[:, :600], pair.left[:, 20:620])


def test_a_smaller_pair_sees_the_same_rays() -> None:
    black = np.zeros((100, 200, 3), np.uint8)
    half = RealPair(black, black, StereoRig(200, 100, 300.0, (99.5, 49.5), 0.1)).scaled(0.5)
    assert half.left.shape == (50, 100, 3)
    assert half.rig == StereoRig(100, 50, 150.0, (49.5, 24.5), 0.1)
