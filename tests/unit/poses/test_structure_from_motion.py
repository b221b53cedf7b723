"""Frames between registered images."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.registration.rigid_motion import between, exponential, fraction
from scenewright.stages.poses.structure_from_motion import interpolated

POSES = {
    0: exponential(np.array([0.1, 0.2, 0.3, 1.0, 2.0, 3.0])),
    4: exponential(np.array([0.2, 0, 0.1, 1.2, 2.1, 3.1])),
}


def test_frames_between_neighbours_lie_on_the_way() -> None:
    registered = {frame: (pose, 0.8) for frame, pose in POSES.items()}
    found = interpolated([0, 1, 2, 3, 4, 5, 6, 8], [0, 4, 8], registered)
    assert [pose.status for pose in found] == ["tracked"] + 3 * ["interpolated"] + ["tracked"] + 3 * ["unposed"]
    assert found[0].world_from_camera is not None and found[2].world_from_camera is not None
    np.testing.assert_allclose(found[0].world_from_camera, np.eye(4), atol=1e-12)
    way = between(POSES[0], POSES[4])
    np.testing.assert_allclose(found[2].world_from_camera, fraction(way, 0.5), atol=1e-9)
    assert found[2].confidence == 0.4 and found[5].fault == "not_registered"
