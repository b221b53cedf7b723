"""A plan as ROS 2 messages, read back by a library that did not write them."""

import json
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from scenewright.schemas.tableware_plan import TablewarePlanFile
from scenewright.stages.tableware.ros2_plan import hand_poses, write_plan_bag
from scipy.spatial.transform import Rotation

PLAN = TablewarePlanFile.read(Path(__file__).parents[2] / "golden" / "v1" / "tableware_plan" / "plan.json")


def test_hands_and_actions_come_back_as_planned(tmp_path: Path) -> None:
    write_plan_bag(tmp_path / "plan.mcap", PLAN)
    with (tmp_path / "plan.mcap").open("rb") as file:
        messages = list(make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages())
    actions = [decoded for _, channel, _, decoded in messages if channel.topic == "/tableware/actions"]
    poses = [(message, decoded) for _, channel, message, decoded in messages if channel.topic == "/tableware/poses"]
    assert len(actions) == len(poses) == len(PLAN.steps) > 1
    begins = 0.0
    for step, action, (message, array) in zip(PLAN.steps, actions, poses, strict=True):
        assert json.loads(action.data) == step.action.model_dump(mode="json", exclude_none=True)
        assert abs(message.log_time - 1e9 * begins) <= 1.0 and array.header.frame_id == "table"
        begins += step.action.seconds
        wanted = list(hand_poses(step.action.fields))
        assert len(array.poses) == len(wanted) >= 1
        for pose, (point, angle) in zip(array.poses, wanted, strict=True):
            assert [pose.position.x, pose.position.y, pose.position.z] == list(point)
            turn = pose.orientation
            axes = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
            np.testing.assert_allclose(axes[:, 0], [np.cos(angle), np.sin(angle), 0.0], atol=1e-12)
            np.testing.assert_allclose(axes[:, 2], [0.0, 0.0, -1.0], atol=1e-12)


def test_the_same_plan_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("first", "second"):
        write_plan_bag(tmp_path / name, PLAN)
    assert (tmp_path / "first").read_bytes() == (tmp_path / "second").read_bytes()
