"""Where the robot starts in the recorded kitchen, and whether it went where nobody was."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.experiments.real_plan import is_behind, stand_of
from schemas.contact_graph import ContactGraphFile, GraphNode
from stages.kit.geometry.boxes import box_from_bounds
from stages.truth.support_annotation import AnnotatedNode


def test_the_robot_starts_under_the_camera_with_most_room_and_looks_at_the_things() -> None:
    table = GraphNode(
        id="table_1", instance=1, class_name="table", node_type="rigid", box=box_from_bounds((0, 0, 0), (1, 1, 0.7))
    )
    lamp = table.model_copy(update={"id": "lamp_2", "box": box_from_bounds((1, -2, 2), (2, -1, 2.3))})
    graph = ContactGraphFile(nodes=(table, lamp), links=())
    cameras = np.array([[0.5, 0.5, 1.6], [0.5, -1.5, 1.6], [0.5, -0.5, 1.6]])
    assert stand_of(cameras, graph) == pytest.approx((0.5, -1.5, 90.0)), "a lamp overhead is in nobody's way"


@pytest.mark.parametrize(("place", "behind"), [((0.5, 2.9), False), ((0.5, 3.1), True), ((4.0, 3.1), False)])
def test_a_place_beyond_a_wall_is_behind_it_along_its_length_alone(place: tuple[float, float], behind: bool) -> None:
    box = {"center": [0, 3, 1], "size": [5, 0.2, 2]}
    wall = AnnotatedNode.model_validate({"name": "wall_back", "class": "wall", "find": {"box": box}})
    assert is_behind([wall], np.array([[0.0, 0.0], place]), np.array([0.0, 0.5])) is behind
