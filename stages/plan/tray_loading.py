"""Where to put things on a tray so that a hand can still take its rim afterwards, and bears what turns it in there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stages.plan.rim_grasps import rim_grasps

if TYPE_CHECKING:
    from stages.plan.world_model import WorldModel

PALM_ROOM = 0.008
"""Free room wanted beside the palm [m]."""
GRAVITY = 9.81


def free_lanes(tool_poses: np.ndarray, feet: np.ndarray, palm: tuple[float, float]) -> np.ndarray:
    """Return, per tool pose from above (N, 4, 4), whether the palm is over none of the round feet: (N,) bool.

    `feet` (K, 3): middle x, y and radius [m] in the frame of the poses. `palm`: its length along which the fingers
    close (tool y) and its breadth (tool x) [m].
    """
    offset = feet[None, :, :2] - tool_poses[:, None, :2, 3]
    along = np.abs(np.einsum("nkd,nd->nk", offset, tool_poses[:, :2, 1])) - palm[0] / 2
    across = np.abs(np.einsum("nkd,nd->nk", offset, tool_poses[:, :2, 0])) - palm[1] / 2
    outside = np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0))
    return np.all(outside > feet[None, :, 2] + PALM_ROOM, axis=1)


def holding_moments(tool_poses: np.ndarray, places: np.ndarray, masses: np.ndarray) -> np.ndarray:
    """Return the moment (N,) [N m] about each tool position (N, 4, 4) of masses (K,) [kg] at places (K, 2) [m]."""
    middle = masses @ places / masses.sum()
    return GRAVITY * masses.sum() * np.linalg.norm(tool_poses[:, :2, 3] - middle, axis=1)


def load_moments(model: WorldModel, tray: str, tool_poses: np.ndarray) -> np.ndarray:
    """Return the moment (N,) [N m] of a tray and what stands on it about each tool pose (N, 4, 4), world."""
    names = (tray, *model.load(tray))
    masses = np.array([model.records[name].mass for name in names])
    return holding_moments(tool_poses, np.array([model.pose(name)[:2, 3] for name in names]), masses)


def lifts_left(model: WorldModel, tray: str, item: str, places: np.ndarray, uncertainty: float = 0.0) -> np.ndarray:
    """Return, per pose world_from_item (N, 4, 4), by how many rim grasps the tray can be lifted when the item stands
    there, the palm over nothing and the fingers bearing the moment: (N,) int. `uncertainty` as in `rim_grasps` [m]."""
    world_from_tray = model.pose(tray)
    grasps = rim_grasps(model.points(tray), world_from_tray, np.random.default_rng(0), uncertainty=uncertainty)
    if not grasps:
        return np.zeros(len(places), dtype=int)
    poses = np.array([world_from_tray @ grasp.body_from_tool for grasp in grasps])
    others = [name for name in model.load(tray) if name != item]
    feet = [[*model.pose(name)[:2, 3], model.footprint(name)[0]] for name in others]
    masses = np.array([model.records[name].mass for name in (tray, *others, item)])
    lifts = []
    for place in places:
        standing = np.array([*feet, [*place[:2, 3], model.footprint(item)[0]]])
        free = free_lanes(poses, standing, model.description.palm)
        moments = holding_moments(poses, np.concatenate([world_from_tray[None, :2, 3], standing[:, :2]]), masses)
        lifts.append(int((free & (moments < model.description.holding_moment)).sum()))
    return np.array(lifts)
