"""Whether the robot went where nobody was in the recorded kitchen."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.truth.support_annotation import AnnotatedNode

from benchmarks.experiments.real_plan import is_behind


@pytest.mark.parametrize(("place", "behind"), [((0.5, 2.9), False), ((0.5, 3.1), True), ((4.0, 3.1), False)])
def test_a_place_beyond_a_wall_is_behind_it_along_its_length_alone(place: tuple[float, float], behind: bool) -> None:
    box = {"center": [0, 3, 1], "size": [5, 0.2, 2]}
    wall = AnnotatedNode.model_validate({"name": "wall_back", "class": "wall", "find": {"box": box}})
    assert is_behind([wall], np.array([[0.0, 0.0], place]), np.array([0.0, 0.5])) is behind
