"""What matching and alignment look at: the observed object x and the CAD shape y (Han 2024, section 2.4.1)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.cad_library import CadModel, ModelState
from scenewright.schemas.contact_graph import GraphNode
from scenewright.schemas.scene_parts import SurfacePlane
from scenewright.stages.kit.geometry.boxes import box_yaw

SAME_YAW = math.radians(5.0)
"""Object frames closer than this are one frame."""
LEAST_PLANE_SHARE = 0.1
"""An upright plane gives an object frame when it has this share of the box's largest side."""


@dataclass(frozen=True)
class Planes:
    """Surface planes as arrays, offsets relative to the centre of the owner's box."""

    normals: np.ndarray
    """(P, 3) unit."""
    offsets: np.ndarray
    """(P,) [m]: n . (v - center) + d = 0."""
    supporting: np.ndarray
    """(P,) bool. Object: carries a child. CAD: is horizontal."""

    def __len__(self) -> int:
        return len(self.offsets)


@dataclass(frozen=True)
class Observed:
    """The segmented entity x in one gravity-aligned frame of its own."""

    yaw: float
    """Of the frame [rad]."""
    center: np.ndarray
    """(3,) world [m]."""
    size: np.ndarray
    """(3,) full lengths along the frame's axes [m]."""
    planes: Planes
    """Normals in the world frame."""
    support_height: float
    """-d^s: height of the plane that the object stands on [m]."""


@dataclass(frozen=True)
class Shape:
    """A CAD model y in one joint configuration."""

    model: CadModel
    joints: dict[str, float]
    center: np.ndarray
    """(3,) of the box, model frame [m]."""
    size: np.ndarray
    """(3,) [m]."""
    planes: Planes
    """Model frame."""
    surfaces: tuple[SurfacePlane, ...]
    """The planes with their rectangles, model frame."""


@dataclass(frozen=True)
class Placement:
    """A CAD shape in the world: p_world = rotation (scale * p_model) + translation."""

    shape: Shape
    scale: float
    rotation: np.ndarray
    """(3, 3) world_from_model."""
    translation: np.ndarray
    """(3,) [m]."""
    matching_error: float
    alignment_error: float
    score: float
    """What the choice minimises: the alignment error (thesis), or with the misfit of the size (ours)."""


def relative_planes(planes: tuple[SurfacePlane, ...], center: np.ndarray, supporting: np.ndarray) -> Planes:
    """Return planes as arrays with offsets relative to `center` (3,): d + n . center."""
    normals = np.array([plane.normal for plane in planes], dtype=float).reshape(-1, 3)
    offsets = np.array([plane.offset for plane in planes], dtype=float)
    return Planes(normals, offsets + normals @ center, np.asarray(supporting, dtype=bool).reshape(len(planes)))


def shape_of_state(model: CadModel, state: ModelState) -> Shape:
    """Return the shape of a library model in one of its stored states."""
    low, high = np.asarray(state.box_minimum), np.asarray(state.box_maximum)
    center = (low + high) / 2
    horizontal = np.array([plane.horizontal for plane in state.planes], dtype=bool)
    return Shape(
        model=model,
        joints=dict(state.joints),
        center=center,
        size=high - low,
        planes=relative_planes(state.planes, center, horizontal),
        surfaces=state.planes,
    )


def observed_frames(
    node: GraphNode, points: np.ndarray, carrying: frozenset[int], support_height: float, *, all_frames: bool
) -> list[Observed]:
    """Return the object in the frame of its box B_x and, with `all_frames`, in those of its upright planes.

    The thesis matches in the frame of the minimum box. The minimum box of an L (a fridge whose door stands open) or
    of a partial mesh lies askew to the body, so that none of the 24 orientations fits; the body's own planes
    say how it is turned. `points` (N, 3): the object's vertices, world frame.
    """
    if node.box is None:
        raise ValueError(f"{node.id} has no box")
    center, size = np.asarray(node.box.center), np.asarray(node.box.size)
    supporting = np.array([k in carrying for k in range(len(node.planes))], dtype=bool)
    yaw = box_yaw(node.box)
    frames = [Observed(yaw, center, size, relative_planes(node.planes, center, supporting), support_height)]
    if not all_frames:
        return frames
    largest_side = max(size[0], size[1]) * size[2]
    upright = [p for p in node.planes if abs(p.normal[2]) < 0.2 and p.area >= LEAST_PLANE_SHARE * largest_side]
    for plane in sorted(upright, key=lambda p: -p.area):
        turn = math.atan2(plane.normal[1], plane.normal[0])
        if any(abs((turn - f.yaw + math.pi / 4) % (math.pi / 2) - math.pi / 4) < SAME_YAW for f in frames):
            continue
        frames.append(frame_at(turn, node, points, supporting, support_height))
    return frames


def frame_at(
    yaw: float, node: GraphNode, points: np.ndarray, supporting: np.ndarray, support_height: float
) -> Observed:
    """Return the object in the upright frame at `yaw` [rad]: as wide as its vertices (N, 3), as high as its box.

    `supporting` (P,) bool: which of the node's planes carry something. Raises ValueError without a box.
    """
    if node.box is None:
        raise ValueError(f"{node.id} has no box")
    cosine, sine = math.cos(yaw), math.sin(yaw)
    flat = points[:, :2] @ np.array([[cosine, -sine], [sine, cosine]])
    ground = np.array([[cosine, -sine], [sine, cosine]]) @ ((flat.min(axis=0) + flat.max(axis=0)) / 2)
    center = np.array([*ground, node.box.center[2]])
    size = np.array([*np.ptp(flat, axis=0), node.box.size[2]])
    return Observed(yaw, center, size, relative_planes(node.planes, center, supporting), support_height)


def turned_frames(first: Observed, node: GraphNode, points: np.ndarray, steps: int) -> list[Observed]:
    """Return the object in `steps` - 1 frames between `first` and a quarter turn from it.

    A cup with a handle has no flat side that says how it is turned, and its box says nothing: it is round but for the
    handle.
    """
    turns = first.yaw + 0.5 * math.pi * np.arange(1, steps) / steps
    return [frame_at(float(yaw), node, points, first.planes.supporting, first.support_height) for yaw in turns]
