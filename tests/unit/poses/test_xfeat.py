"""XFeat: its maps become corners; a file that is no such network is refused; the real one finds a real room again."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.registration.rigid_motion import angle_of, between, distance_of
from scenewright.stages.poses import xfeat
from scenewright.stages.poses.features import Corners, Features, find_features, orb_corners, ransac_motion

from tests.real_data import real_data

OFFICE = Camera(width=540, height=360, fx=495.57, fy=495.48, cx=269.5, cy=169.19)


def test_cells_are_unfolded_row_by_row() -> None:
    logits = np.zeros((65, 3, 4), np.float32)
    logits[64] = 5.0
    logits[3 * 8 + 5, 1, 2] = 9.0
    corners = xfeat._corners(logits)
    assert corners.shape == (24, 32) and np.unravel_index(corners.argmax(), corners.shape) == (8 + 3, 16 + 5)
    assert corners[11, 21] == pytest.approx(np.exp(9) / (np.exp(9) + np.exp(5) + 63))


def test_maps_are_read_between_the_middles_of_their_cells() -> None:
    rows, columns = np.mgrid[0:6, 0:8].astype(float)
    middles = np.stack([8 * columns + 3.5, 8 * rows + 3.5])
    places = np.array([[10, 20], [33, 7], [3, 41]])
    np.testing.assert_allclose(xfeat._sampled(middles, places), np.array([[10, 20], [33, 7], [3.5, 41]]))


def test_a_file_that_is_no_such_network(tmp_path: Path) -> None:
    file = tmp_path / "network.onnx"
    file.write_bytes(b"no network")
    with pytest.raises(BadInput, match=r"network.onnx is not an ONNX network") as caught:
        xfeat.XFeat(file)
    assert "xfeat" in caught.value.hint


def test_another_network_is_refused() -> None:
    with pytest.raises(BadInput, match="does not have the input and outputs of XFeat"):
        xfeat.XFeat(real_data("detectors") / "yolox_nano.onnx")


def test_real_frames_that_orb_does_not_find_again() -> None:
    """Of pairs five frames apart (0.5 s, 20 degrees and more) XFeat places more within 3 degrees and 10 cm than ORB."""
    office, network = real_data("hololens_office"), xfeat.XFeat(real_data("networks") / "xfeat.onnx")
    rows = [line.split() for line in (office / "poses.txt").read_text().splitlines()]
    given = np.array([[float(word) for word in row[1:17]] for row in rows]).reshape(-1, 4, 4)
    colors, depths = sorted((office / "color").iterdir()), sorted((office / "depth").iterdir())

    def features(frame: int, corners: Corners) -> Features:
        color, depth = cv2.imread(str(colors[frame])), cv2.imread(str(depths[frame]), cv2.IMREAD_UNCHANGED)
        assert color is not None and depth is not None
        return find_features(color[..., ::-1].copy(), depth.astype(np.float32) / 1000, OFFICE, 4.5, corners)

    def is_right(frame: int, corners: Corners) -> bool:
        found = ransac_motion(features(frame, corners), features(frame + 5, corners), np.random.default_rng(0))
        if found is None:
            return False
        off = inverse(between(given[frame], given[frame + 5])) @ found.target_from_source
        return bool(angle_of(off) < np.radians(3) and distance_of(off) < 0.1)

    right = [[is_right(frame, corners) for frame in range(20, 181, 20)] for corners in (orb_corners, network)]
    assert sum(right[1]) > sum(right[0]), right
