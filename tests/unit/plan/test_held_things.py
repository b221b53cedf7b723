"""How things are taken: about their middle, off the palm."""

from __future__ import annotations

import numpy as np
import trimesh
from scenewright.stages.kit.acting.hand.sampled_grasps import sample_grasps
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.simulation.shapes import surface_points
from scenewright.stages.plan.pick_place import HAND_END, PALM_BEHIND, _palm_free

PALM = (0.21, 0.066)


def test_what_is_held_does_not_touch_the_palm() -> None:
    """A tall can: from a hand that comes tilted, some grasps have its top against the palm."""
    points, normals = surface_points(
        [trimesh.creation.cylinder(radius=0.028, height=0.13)], 3000, np.random.default_rng(0)
    )
    grasps = sample_grasps(points, normals, np.eye(4), opening=0.08, random=np.random.default_rng(1))
    kept = _palm_free(points, grasps, PALM)
    assert 0 < len(kept) < len(grasps)
    for grasp in kept:
        own = apply(inverse(grasp.body_from_tool), points)
        within = np.all(np.abs(own[:, :2]) < np.array(PALM[::-1]) / 2, axis=1)
        assert not np.any(within & (own[:, 2] < -PALM_BEHIND) & (own[:, 2] > -HAND_END))
