"""Where the robot stands at the beginning: the roomiest free place of the floor, or of those where the camera was."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.plan.world_model import WorldModel

SHELL = ("floor", "wall", "ceiling")
"""Classes of the room itself, beside which the robot does not start."""


def start_base(
    model: WorldModel, arm: np.ndarray, random: np.random.Generator, count: int = 400, cameras: np.ndarray | None = None
) -> np.ndarray:
    """Return a base pose (3,) x, y [m], yaw [rad]: of `count` random free ones, the farthest from furniture and walls.

    Given where the camera was (`cameras` (N, 3) [m]), the places are under it, up to `count` of them, evenly spread:
    somebody stood there, on this side of the walls; the robot looks towards the middle of what stands about. Distances
    are to the boxes of bodies below 1 m, in the plane. Raises MotionFailed `start_in_collision` when no place is free.
    """
    low, high = model.room
    boxes = []
    for name, record in model.records.items():
        if record.class_name in SHELL:
            continue
        bottom, top = model.world.bounds(name)
        if bottom[2] < 1.0:
            boxes.append((bottom[:2], top[:2]))
    if cameras is None or not len(cameras):
        places = random.uniform(low + 0.2, high - 0.2, size=(count, 2))
        turns = random.uniform(-np.pi, np.pi, size=count)
        distance = np.minimum((places - low).min(axis=1), (high - places).min(axis=1))
    else:
        places = cameras[np.unique(np.linspace(0, len(cameras) - 1, count).astype(int)), :2]
        ahead = np.mean([np.mean(box, axis=0) for box in boxes] or [(low + high) / 2], axis=0) - places
        turns = np.arctan2(ahead[:, 1], ahead[:, 0])
        distance = np.full(len(places), np.inf)
    for bottom, top in boxes:
        away = np.maximum(np.maximum(bottom - places, places - top), 0.0)
        distance = np.minimum(distance, np.linalg.norm(away, axis=1))
    for index in np.argsort(-distance, kind="stable"):
        base = np.array([*places[index], turns[index]])
        collision = model.checker.check(np.concatenate([base, arm]))
        if collision is None:
            return base
    raise MotionFailed(
        "start_in_collision",
        f"none of {len(places)} places on the floor is free for the robot",
        (),
        {"tried": len(places)},
    )
