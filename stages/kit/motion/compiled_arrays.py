"""Plain arrays that the compiled collision check reads: the robot (with what it carries) and the scene."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

CHECK, SKIP, RESTING = 0, 1, 2
"""Kinds of a pair of a robot part and a scene link: looked at, may touch, may sink in a little (the mesh checker
decides)."""


RADIUS = 3
"""Column of balls (N, 4), behind their centre."""
BASE_X, BASE_Y, BASE_YAW, ARM = range(4)
"""Places in a configuration (3 + J,): the base [m, rad], and where the arm's joints begin."""


class RobotArrays(NamedTuple):
    """Convex pieces of the robot, each fixed to a frame: 0 is the arm's mount on the pedestal, j the j-th arm joint.

    The last pieces may be those of the carried body, on the last frame.
    """

    fixed: np.ndarray
    """(J, 4, 4) parent_from_joint of each arm joint at value 0."""
    mount_height: float
    """Of frame 0 above the floor [m]."""
    frame: np.ndarray
    """(R,) frame of each piece."""
    part: np.ndarray
    """(R,) index of the piece's link in the names of the parts."""
    bound: np.ndarray
    """(R, 4) centre and radius of a ball around each piece, its frame."""
    sphere_begin: np.ndarray
    """(R + 1,)"""
    spheres: np.ndarray
    """(S, 4) balls whose union holds each piece."""
    vertex_begin: np.ndarray
    """(R + 1,)"""
    vertices: np.ndarray
    """(V, 3)"""
    pairs: np.ndarray
    """(K, 2) pieces that must not meet."""
    pair_distance: np.ndarray
    """(K,) distance [m] that counts as apart."""


class SceneArrays(NamedTuple):
    """Convex pieces of the scene in groups, one group per link of a body."""

    low: np.ndarray
    """(G, 3) world bounds of each group."""
    high: np.ndarray
    piece_begin: np.ndarray
    """(G + 1,)"""
    allowed: np.ndarray
    """(parts, G) CHECK, SKIP or RESTING."""
    pose: np.ndarray
    """(P, 3, 4) world_from_link of each piece."""
    box: np.ndarray
    """(P, 3, 4) box_from_world of the box around each piece."""
    half: np.ndarray
    """(P, 3) half its sides."""
    vertex_begin: np.ndarray
    """(P + 1,)"""
    vertices: np.ndarray
    """(V, 3) link frame."""
    distance: float
    """That counts as apart [m]."""
