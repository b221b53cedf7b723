"""Every named convention undoes what somebody who writes poses in that convention does."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.pose_convention_names import CONVENTION_WORDS, POSE_CONVENTIONS
from scenewright.stages.ingest.pose_conventions import converted
from scenewright.stages.kit.geometry.transforms import apply, is_rigid
from scipy.spatial.transform import Rotation

POINT = np.array([0.3, -0.2, 1.5])
"""Right, up and ahead of the camera, in OpenCV axes."""


def pose_of(seed: int) -> np.ndarray:
    random = np.random.default_rng(seed)
    pose = np.eye(4)
    pose[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    pose[:3, 3] = random.normal(0, 2, 3)
    return pose


def written_with(order: str, pose: np.ndarray) -> np.ndarray:
    """Pose as a reader gets it that takes a quaternion written in one order for the other."""
    x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
    read = {"wxyz": (w, x, y, z), "xyzw": (y, z, w, x)}[order]  # what the reader calls x, y, z, w
    result = pose.copy()
    result[:3, :3] = Rotation.from_quat(read).as_matrix()
    return result


def body_of(pose: np.ndarray) -> np.ndarray:
    """World_from_body of a body whose x is the camera's z, y its -x, z its -y, column by column."""
    result = pose.copy()
    result[:3, 0], result[:3, 1], result[:3, 2] = pose[:3, 2], -pose[:3, 0], -pose[:3, 1]
    return result


def opengl_of(pose: np.ndarray) -> np.ndarray:
    result = pose.copy()
    result[:3, 1:3] *= -1
    return result


def left_handed_of(pose: np.ndarray) -> np.ndarray:
    """The pose for who counts y the other way, in the world and in the camera."""
    result = pose.copy()
    result[1, :] *= -1
    result[:, 1] *= -1
    return result


WRITERS = {
    "as-is": lambda pose: pose,
    "inverse": np.linalg.inv,
    "opengl": opengl_of,
    "inverse-opengl": lambda pose: np.linalg.inv(opengl_of(pose)),
    "ros-body": body_of,
    "inverse-ros-body": lambda pose: np.linalg.inv(body_of(pose)),
    "left-handed": left_handed_of,
    "quaternion-wxyz": lambda pose: written_with("wxyz", pose),
    "quaternion-xyzw": lambda pose: written_with("xyzw", pose),
    "inverse-quaternion-wxyz": lambda pose: written_with("wxyz", np.linalg.inv(pose)),
}


def test_every_convention_has_a_writer_and_words() -> None:
    assert set(WRITERS) == set(POSE_CONVENTIONS) == set(CONVENTION_WORDS)
    assert IngestParameters.model_fields["pose_convention"].default == "as-is"


@pytest.mark.parametrize("name", POSE_CONVENTIONS)
@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 10_000))
def test_conversion_undoes_the_writer(name: str, seed: int) -> None:
    pose = pose_of(seed)
    found = converted(WRITERS[name](pose)[None], name)[0]
    assert is_rigid(found, 1e-9)
    np.testing.assert_allclose(found, pose, atol=1e-9)
    np.testing.assert_allclose(apply(found, POINT), apply(pose, POINT), atol=1e-9)


@pytest.mark.parametrize("name", POSE_CONVENTIONS)
def test_scale_is_of_what_the_log_has(name: str) -> None:
    pose = pose_of(3)
    written = WRITERS[name](pose).copy()
    written[:3, 3] *= 1000
    np.testing.assert_allclose(converted(written[None], name, 0.001)[0], pose, atol=1e-9)


@pytest.mark.parametrize("name", POSE_CONVENTIONS)
def test_input_is_left_alone_and_none_is_fine(name: str) -> None:
    poses = np.array([pose_of(1), pose_of(2)])
    before = poses.copy()
    converted(poses, name, 2.0)[:] = 0
    np.testing.assert_array_equal(poses, before)
    assert converted(np.zeros((0, 4, 4)), name).shape == (0, 4, 4)


def test_unknown_convention() -> None:
    with pytest.raises(KeyError):
        converted(np.eye(4)[None], "nonsense")  # type: ignore[arg-type]
