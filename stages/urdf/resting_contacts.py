"""Which links of a scene touch while nothing moves."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
from scenewright.stages.kit.simulation.engine import engine
from scenewright.stages.kit.simulation.world import load_scene
from scenewright.stages.urdf.scene_penetration import link_padding

REACH = 0.002
"""Links that are closer than this [m] touch."""


def resting_contacts(scene_folder: Path) -> list[tuple[str, str]]:
    """Return the pairs of links of an interactive scene that are less than 2 mm apart or lie in each other, with its
    bodies and joints as scene.json says. Links that a joint connects are among them. Raises BadInput.
    """
    with load_scene(scene_folder) as world:
        links = [
            (body.body_id, index, name, np.array(engine.getAABB(body.body_id, index, physicsClientId=world.client)))
            for body in world.bodies.values()
            for name, index in body.links.items()
        ]
        touching = []
        for (body, index, name, bounds), (other_body, other_index, other_name, other_bounds) in combinations(links, 2):
            if (bounds[0] > other_bounds[1] + REACH).any() or (other_bounds[0] > bounds[1] + REACH).any():
                continue
            reach = (
                REACH - link_padding(world.client, body, index) - link_padding(world.client, other_body, other_index)
            )
            if engine.getClosestPoints(body, other_body, reach, index, other_index, physicsClientId=world.client):
                touching.append((name, other_name))
    return touching
