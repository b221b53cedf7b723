"""Ours: a thing that no model of the library explains may be built in: a run of boxes that was made for its room.

It is a model like those of the library, made for one node: carcasses (`carcasses.py`), and leaves where the log shows
one move (`built_in_leaves.py`). It stands for its node only where it explains what the map shows, fills next to nothing
that was seen to be empty, keeps the places on which things stand, and where it is better than the node's box.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.articulations import Articulation
from scenewright.schemas.base import as_vector
from scenewright.schemas.cad_library import CadModel, ModelState
from scenewright.schemas.contact_graph import GraphNode
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.cad.built_in_leaves import BuiltInLeaf, leaves_of, shifted
from scenewright.stages.cad.carcasses import CLOSEST, Cells, Patches, cells_of, own_yaw, patches_of
from scenewright.stages.cad.made_models import BODY, BUILT_IN, part_of, plane_of, quad, rectangle_area, solid_box
from scenewright.stages.cad.model_surfaces import ModelSurface, facing_side, load_surface
from scenewright.stages.cad.shapes import Placement, shape_of_state
from scenewright.stages.cad.target import Surroundings
from scenewright.stages.kit.formats.entity_meshes import EntityMesh
from scenewright.stages.kit.formats.model_writer import write_model_folder
from scenewright.stages.kit.geometry.boxes import bottom, points_in_box
from scenewright.stages.kit.geometry.substances import substance_of
from scenewright.stages.kit.geometry.transforms import transform_from_yaw

CLASSES = frozenset(
    {
        *("object", "cabinet", "wall_cabinet", "shelf", "wall_shelf", "wardrobe", "drawer_unit", "chest"),
        *("fridge", "oven", "dishwasher", "washing_machine", "door", "window"),
    }
)
"""Classes that are built of boards and fronts and stay where they are, and what has no name."""
LEAST_EDGE = 0.5
"""Least length of the longest edge [m]: smaller things are not built in (and nameless ones may be movable)."""
NEAR = 0.03
"""Largest distance from a surface that faces its way at which surface is explained [m]."""
EXPLAINED = 0.75
"""Share of what was seen that a built-in, or a form of a family, explains."""
LEVEL_KEPT, SAME_LEVEL = 0.9, 0.02
"""Share of what was seen and looks up that lies so near [m] to surface of a built-in that does."""
MOST_FILLED, DEEP = 0.1, 0.05
"""Share of a built-in's surface that may lie deeper than this [m] in space that was seen to be empty: the undersides of
boards, which hardly a camera sees, are guessed."""
LEAST_LEVEL = 0.05
"""Less surface that looks up is no place to put things on [m²]."""
MOST_BOXES = 60
"""A carcass of more boxes is no piece of furniture; by eye."""
TRUNCATION = 0.1
"""Distances are cut off here when a built-in is compared with the box [m]."""
STRAYS = 0.005
"""Share of the surface, at either end of an axis, that may lie outside the boxes."""
FEWEST = 20
"""Patches of surface without which nothing can be said."""
SPACING = 0.05
"""Distance between the points at which a built-in's surface is held against seen space [m]."""


@dataclass(frozen=True)
class Fit:
    """How what is full fits a surface."""

    explained: float
    """Share of the surface that lies near."""
    level_kept: float
    """Share of what looks up that lies near surface that does."""
    distance: float
    """Mean distance from the surface, cut off at `TRUNCATION` [m]."""
    filled: float
    """Share of its own surface that lies in space seen to be empty."""
    empty_depth: float
    """Mean depth there [m]."""

    @property
    def error(self) -> float:
        """Both ways [m]."""
        return self.distance + self.empty_depth


@dataclass(frozen=True)
class BuiltIn:
    """A built-in where it stands, its surface, and how it and the box around it fit."""

    placement: Placement
    surface: ModelSurface
    boxes: int
    leaves: int
    fit: Fit
    box_fit: Fit


def may_be_built_in(node: GraphNode) -> bool:
    """Whether a node is of a class that is built in, and large enough."""
    return node.class_name in CLASSES and node.box is not None and max(node.box.size) >= LEAST_EDGE


def built_in(
    around: Surroundings, mesh: EntityMesh, articulations: Sequence[Articulation], folder: Path
) -> BuiltIn | str:
    """Fit a built-in to the mesh of a node, world frame, and write its model to `folder`; or return why there is none.

    `articulations`: what the log shows moving.
    """
    node = around.node
    assert node.box is not None  # may_be_built_in
    patches = patches_of(mesh)
    if node.box_observed is not None:
        patches = patches.chosen(points_in_box(node.box_observed, patches.points, margin=0.01))
    if len(patches.areas) < FEWEST:
        return "hardly any surface"
    patches, rotation = _from_the_front(patches)
    low, high = _bounds(patches)
    low[2] = min(bottom(node.box), low[2] + NEAR)
    if np.any(high - low < 2 * CLOSEST) or max(high - low) < LEAST_EDGE:
        return "too small or flat to be built in"

    def empty_depth(points: np.ndarray) -> np.ndarray:
        return around.free_space.depth_within(points @ rotation.T)

    cells = cells_of(patches, low, high, lambda points: empty_depth(points) > NEAR)
    x, y, z = (np.array([low[a], high[a]]) for a in range(3))
    bounding_box = Cells((x, y, z), np.ones((1, 1, 1), dtype=bool))
    fit, plain = fit_of(cells, patches, empty_depth), fit_of(bounding_box, patches, empty_depth)
    if plain.error <= fit.error:
        cells, fit = bounding_box, plain
    reason = _why_not(fit, len(cells.boxes()))
    if reason:
        return reason
    cells, leaves = leaves_of(cells, rotation, articulations)
    placement, surface = _write_built_in(node, cells, leaves, rotation, folder)
    return BuiltIn(placement, surface, len(cells.boxes()), len(leaves), fit, plain)


def _why_not(fit: Fit, boxes: int) -> str:
    """Return why a fit is none, or nothing."""
    if boxes > MOST_BOXES:
        return f"it takes {boxes} boxes"
    if fit.explained < EXPLAINED:
        return f"boxes explain {fit.explained:.0%} of it"
    if fit.level_kept < LEVEL_KEPT:
        return f"boxes keep {fit.level_kept:.0%} of its level surface"
    return f"{fit.filled:.0%} of its boxes would fill space seen to be empty" if fit.filled > MOST_FILLED else ""


def fit_of(cells: Cells, patches: Patches, empty_depth: Callable[[np.ndarray], np.ndarray]) -> Fit:
    """Return how well what is full fits a surface, both in the frame of the cells. `empty_depth`: points (N, 3) ->
    how deep they lie in space seen to be empty (N,) [m]."""
    sides = {(axis, up): cells.sides(axis, up) for axis in range(3) for up in (False, True)}
    everything = [rectangle for rectangles in sides.values() for rectangle in rectangles]
    if not everything:
        return Fit(0.0, 0.0, TRUNCATION, 1.0, TRUNCATION)
    distance = np.full(len(patches.areas), TRUNCATION)
    facing = facing_side(patches.normals)
    for (axis, up), rectangles in sides.items():
        rows = np.flatnonzero(facing == 2 * axis + up)
        for low, high in rectangles:
            outside = np.maximum(np.maximum(low - patches.points[rows], patches.points[rows] - high), 0.0)
            distance[rows] = np.minimum(distance[rows], np.linalg.norm(outside, axis=1))
    explained, looks_up = distance < NEAR, facing == 5
    level = patches.areas[looks_up]
    points, areas = spread(everything)
    depth = empty_depth(points)
    return Fit(
        explained=_share(explained, patches.areas),
        level_kept=_share(distance[looks_up] < SAME_LEVEL, level) if level.sum() >= LEAST_LEVEL else 1.0,
        distance=float(np.average(distance, weights=patches.areas)),
        filled=_share(depth > DEEP, areas),
        empty_depth=float(np.average(np.minimum(depth, TRUNCATION), weights=areas)),
    )


def _share(chosen: np.ndarray, areas: np.ndarray) -> float:
    return float(areas[chosen].sum() / areas.sum()) if areas.sum() > 0 else 1.0


def spread(rectangles: Sequence[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Return points (N, 3) all over rectangles, at most `SPACING` apart, and the area (N,) [m²] of each."""
    points, areas = [], []
    for low, high in rectangles:
        axes = []
        for a in range(3):
            count = max(1, math.ceil((high[a] - low[a]) / SPACING))
            axes.append(low[a] + (np.arange(count) + 0.5) * (high[a] - low[a]) / count)
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        points.append(grid)
        areas.append(np.full(len(grid), rectangle_area(low, high) / len(grid)))
    return np.concatenate(points), np.concatenate(areas)


def _bounds(patches: Patches) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners (3,) of the box that holds all of a surface but strays."""
    order = np.argsort(patches.points, axis=0)
    low, high = np.zeros(3), np.zeros(3)
    for axis in range(3):
        sums = np.cumsum(patches.areas[order[:, axis]])
        first, last = np.searchsorted(sums, [STRAYS * sums[-1], (1 - STRAYS) * sums[-1]])
        low[axis], high[axis] = patches.points[order[[first, last], axis], axis]
    return low, high


def _from_the_front(patches: Patches) -> tuple[Patches, np.ndarray]:
    """Return the surface in its own frame, most of what is upright facing -y, and world_from_own (3, 3)."""
    yaw = own_yaw(patches)
    turned = patches.turned(transform_from_yaw(yaw, np.zeros(3))[:3, :3])
    side = facing_side(turned.normals)
    areas = [float(patches.areas[side == k].sum()) for k in (2, 1, 3, 0)]  # faces -y, +x, +y, -x
    rotation = transform_from_yaw(yaw + 0.5 * math.pi * int(np.argmax(areas)), np.zeros(3))[:3, :3]
    return patches.turned(rotation), rotation


def _write_built_in(
    node: GraphNode, cells: Cells, leaves: Sequence[BuiltInLeaf], rotation: np.ndarray, folder: Path
) -> tuple[Placement, ModelSurface]:
    """Write the model of a built-in and return where it stands, and its surface."""
    boxes = [*cells.boxes(), *(span for leaf in leaves for span in leaf.boxes)]
    low, high = np.min([a for a, _ in boxes], axis=0), np.max([b for _, b in boxes], axis=0)
    origin = np.array([*(0.5 * (low + high))[:2], low[2]])
    leaves = [shifted(leaf, -origin) for leaf in leaves]
    density = substance_of(node.class_name).hull_density
    body = [solid_box(a - origin, b - origin) for a, b in cells.boxes()]
    sides = [
        (axis, up, a - origin, b - origin)
        for axis in range(3)
        for up in (False, True)
        for a, b in cells.sides(axis, up)
    ]
    geometries = [part_of(BODY, body, density, [quad(*side) for side in sides])]
    joints = []
    for k, leaf in enumerate(leaves, 1):
        name = f"leaf_{k}"
        geometries.append(part_of(name, [solid_box(a - leaf.origin, b - leaf.origin) for a, b in leaf.boxes], density))
        joints.append(
            Joint(
                name=name,
                type=leaf.type,
                part=name,
                origin=as_vector(leaf.origin),
                axis=as_vector(leaf.axis),
                lower=0.0,
                upper=leaf.travel,
                handle=as_vector(_handle(leaf)),
            )
        )
    state = ModelState(
        joints={joint.name: 0.0 for joint in joints},
        box_minimum=as_vector(low - origin),
        box_maximum=as_vector(high - origin),
        planes=tuple(plane_of(*side) for side in sides),
    )
    model = CadModel(
        id=f"{node.id}_built_in",
        class_name=node.class_name,
        articulated=bool(joints),
        mass=sum(part.properties.mass for part in geometries),
        states=(state,),
        joints=tuple(joints),
        movable=False,
        contains=bool(joints),
        parts=tuple(part.name for part in geometries),
        recipe={BUILT_IN: node.id},
    )
    write_model_folder(folder, model, geometries)
    values = {joint.name: leaf.value for joint, leaf in zip(joints, leaves, strict=True)}
    shape = shape_of_state(model, state.model_copy(update={"joints": values}))
    return Placement(shape, 1.0, rotation, rotation @ origin, 0.0, 0.0, 0.0), load_surface(folder, model)


def _handle(leaf: BuiltInLeaf) -> np.ndarray:
    """Return where a leaf is taken (3,): the middle of a drawer's front; of a door's, half way to the far edge."""
    low, high = leaf.boxes[0]
    middle = 0.5 * (low + high)
    if leaf.type == "prismatic":
        return middle
    arm = middle - leaf.origin
    arm = arm - (arm @ leaf.axis) * leaf.axis
    return np.clip(middle + 0.8 * arm, low, high)
