"""Where to put things on a tray so that a hand can still take its rim afterwards, and bears what turns it in there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scenewright.stages.kit.acting.hand.grip import narrowest_width
from scenewright.stages.kit.acting.hand.rim_grasps import rim_grasps

if TYPE_CHECKING:
    from scenewright.stages.plan.world_model import WorldModel

PALM_ROOM = 0.008
"""Free room wanted beside the palm [m]."""
BESIDE = 0.012
"""Things stand at least this far apart [m]: a finger is between them as one is put down."""
GRAVITY = 9.81
"""Acceleration of gravity [m/s^2]."""


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


def twisting_moments(tool_poses: np.ndarray, places: np.ndarray, masses: np.ndarray) -> np.ndarray:
    """Return what of `holding_moments` (N,) [N m] turns the load about the axis along which fingers close (tool y):
    pads resist that by friction alone."""
    middle = masses @ places / masses.sum()
    along = np.einsum("nd,nd->n", middle - tool_poses[:, :2, 3], tool_poses[:, :2, 0])
    return GRAVITY * masses.sum() * np.abs(along)


def _masses(model: WorldModel, tray: str) -> tuple[np.ndarray, np.ndarray]:
    """Return places (K, 2) and masses (K,) [kg] of a tray and of what stands on it."""
    names = (tray, *model.load(tray))
    places = np.array([model.pose(name)[:2, 3] for name in names])
    return places, np.array([model.records[name].mass for name in names])


def load_moments(model: WorldModel, tray: str, tool_poses: np.ndarray) -> np.ndarray:
    """Return the moment (N,) [N m] of a tray and what stands on it about each tool pose (N, 4, 4), world."""
    return holding_moments(tool_poses, *_masses(model, tray))


def easiest_first(model: WorldModel, tray: str, tool_poses: np.ndarray) -> np.ndarray:
    """Return the indices (N,) of tool poses (N, 4, 4), world, by the moment of a tray and its load in tenths [N m], and
    of those alike by what of it twists them in the fingers."""
    places, masses = _masses(model, tray)
    moments, twists = (of(tool_poses, places, masses) for of in (holding_moments, twisting_moments))
    return np.lexsort((twists.round(2), moments.round(1)))


class Lifts:
    """The rim grasps of a tray with its load, and how many of them are left when more is put on it."""

    def __init__(self, model: WorldModel, tray: str, more: tuple[str, ...], uncertainty: float) -> None:
        world_from_tray = model.pose(tray)
        grasps = rim_grasps(model.points(tray), world_from_tray, np.random.default_rng(0), uncertainty=uncertainty)
        self._poses = np.array([world_from_tray @ grasp.body_from_tool for grasp in grasps]).reshape(-1, 4, 4)
        self._middle = world_from_tray[:2, 3]
        self._standing = {name: model.pose(name)[:2, 3] for name in model.load(tray)}
        names = {*self._standing, *more}
        self._radius = {name: model.footprint(name)[0] for name in names}
        self._mass = {name: model.records[name].mass for name in (tray, *names)}
        self._tray, self._hand = tray, model.description

    def left(self, put: dict[str, np.ndarray]) -> int:
        """Return by how many the tray is lifted with things put at places (2,), world: the palm over nothing, the
        fingers bearing the moment."""
        if not len(self._poses):
            return 0
        at = self._standing | put
        feet = np.array([[*position, self._radius[name]] for name, position in at.items()])
        masses = np.array([self._mass[name] for name in (self._tray, *at)])
        moments = holding_moments(self._poses, np.concatenate([self._middle[None], feet[:, :2]]), masses)
        return int((free_lanes(self._poses, feet, self._hand.palm) & (moments < self._hand.holding_moment)).sum())


def lifts_left(model: WorldModel, tray: str, item: str, places: np.ndarray, uncertainty: float = 0.0) -> np.ndarray:
    """Return, per pose world_from_item (N, 4, 4), by how many rim grasps the tray can be lifted when the item stands
    there, the palm over nothing and the fingers bearing the moment: (N,) int. `uncertainty` as in `rim_grasps` [m]."""
    lifts = Lifts(model, tray, (item,), uncertainty)
    return np.array([lifts.left({item: pose[:2, 3]}) for pose in places], dtype=int)


def lifts_left_beside(
    model: WorldModel, tray: str, item: str, places: np.ndarray, other: str, spots: np.ndarray, uncertainty: float = 0.0
) -> np.ndarray:
    """Return the same per pose (N, 4, 4) of an item that `other` is put beside later: with that at the best of the
    poses `spots` (M, 4, 4) where it has room; what sticks out of things, as handles do, can be turned away."""
    lifts = Lifts(model, tray, (item, other), uncertainty)
    apart = BESIDE + sum(narrowest_width(model.points(name)) / 2 for name in (item, other))
    lifts_per_pose = np.zeros(len(places), dtype=int)
    for number, pose in enumerate(places):
        for spot in spots:
            if np.linalg.norm(pose[:2, 3] - spot[:2, 3]) > apart:
                lifts_per_pose[number] = max(
                    lifts_per_pose[number], lifts.left({item: pose[:2, 3], other: spot[:2, 3]})
                )
    return lifts_per_pose
