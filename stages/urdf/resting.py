"""Let movable bodies come to rest: what a reconstruction left hovering or tilted by a little lies down.

A pose from a map is exact to a few millimetres, and a thing that hovers by three of them drops when a simulator is
started. So the written scene is let go once; bodies that come to rest close by are written where they rest, and
scene.json says so. What goes further was misplaced: it keeps its pose, and the settle test names it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.stages.kit.formats.scene_bundle import BundleBody
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.simulation.world import load_scene
from scenewright.stages.urdf.settle_report import free_bodies
from scipy.spatial.transform import Rotation

SECONDS = 3.0
"""Simulated time in which bodies come to rest [s]; by eye."""
PADDING, SMALLEST_MOVE, SMALLEST_TURN = 0.002, 0.0005, np.radians(0.5)
"""Smallest gap [m], move [m] and turn [rad] that count: Bullet pads the hulls of two meshes by 1 mm each, and lifts
what stands on another by as much for every contact below it."""
LARGEST_MOVE, LARGEST_TURN = 0.01, np.radians(5.0)
"""A body that goes further [m], [rad] was misplaced."""
STILL = 0.005
"""A body at rest is slower than this [m/s], [rad/s]."""


def rested_bodies(root: Path, bodies: Sequence[BundleBody]) -> list[BundleBody]:
    """Return the bodies of the scene written to `root`, movable ones where they rest.

    A body whose carrier went too far is left alone as well: what it stands on is not there.
    """
    poses = _rest(root)
    by_name = {body.name: body for body in bodies}

    def near(body: BundleBody | None) -> bool:
        """Whether a body and all that carries it ended close to where they were."""
        if body is None or not body.movable:
            return True
        moved, turned = _motion(body, poses)
        return moved <= LARGEST_MOVE and turned <= LARGEST_TURN and near(by_name.get(body.parent or ""))

    def smallest_move(body: BundleBody) -> float:
        """Return the least move that is no work of the padding [m]."""
        contacts, carrier = 1, by_name.get(body.parent or "")
        while carrier is not None and carrier.movable:
            contacts, carrier = contacts + 1, by_name.get(carrier.parent or "")
        return SMALLEST_MOVE + PADDING * contacts

    return [
        _at_new_pose(body, poses[body.name], smallest_move(body)) if body.name in poses and near(body) else body
        for body in bodies
    ]


def _rest(root: Path) -> dict[str, np.ndarray]:
    """Return movable body -> world_from_body (4, 4) after the scene was let go, of those that lie still then."""
    with load_scene(root) as world:
        names = free_bodies(world)
        world.step(round(SECONDS / world.time_step))
        return {name: world.pose(name) for name in names if max(world.velocity(name)) < STILL}


def _motion(body: BundleBody, poses: dict[str, np.ndarray]) -> tuple[float, float]:
    """Return by how much the middle of a body moved [m] and how far it turned [rad]; infinite when it found no rest."""
    if body.name not in poses:
        return np.inf, np.inf
    change = poses[body.name] @ inverse(body.world_from_body)
    middle = np.array(body.box.center)
    turned = float(Rotation.from_matrix(change[:3, :3]).magnitude())
    return float(np.linalg.norm(apply(change, middle[None])[0] - middle)), turned


def _at_new_pose(body: BundleBody, world_from_body: np.ndarray, smallest_move: float) -> BundleBody:
    """Return the body at its new pose; the same one when it moved less than `smallest_move` [m] and hardly turned."""
    moved, turned = _motion(body, {body.name: world_from_body})
    if moved < smallest_move and turned < SMALLEST_TURN:
        return body
    change = world_from_body @ inverse(body.world_from_body)
    center = as_vector(apply(change, np.array(body.box.center)[None])[0])
    return replace(
        body,
        world_from_body=world_from_body,
        box=body.box.model_copy(update={"center": center}),
        reconstructed=body.world_from_body,
    )
