"""Edits of a panoptic map, each a function that changes the state and says which things it touched."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.schemas.edits import Add, Anchor, Delete, Merge, Rename, SetFloor, SetGravity, Split
from scenewright.schemas.hand_written import UprightBox
from scenewright.schemas.scene_parts import Box
from scenewright.stages.edit.anchoring import Conflict, Fitting, find, joint_anchor, passes, shares
from scenewright.stages.edit.applying import Done, Table
from scenewright.stages.edit.map_state import MapState, Thing
from scenewright.stages.kit.geometry.boxes import box_rotation, gravity_aligned_box, points_in_box, top, upright_box
from scenewright.stages.kit.geometry.transforms import rotation_between, transform_from
from scipy.spatial import cKDTree

FEWEST_VERTICES = 20
"""Fewest vertices of a thing that an edit makes or leaves, as in `fuse`."""
MOST_STEPS = 200
"""Along an edge of a box that is drawn into the map."""

MOSTLY_ONE = 0.8
"""Share of the surface of every merged thing that has to lie in a whole for the edit to be done already."""
FLOOR = "floor"
THICKNESS = 0.02
"""Thickness of a floor that is drawn [m]."""
FLOOR_STEP = 0.05
"""Between its vertices [m]."""
NARROWEST = 0.05
"""Places that are to be level are spread by this across their line [m]."""
STEEPEST, LEVEL_ENOUGH = 80.0, 0.1
"""Degrees."""
BOX_TOLERANCE = 1e-3
"""Boxes that people wrote are rounded to millimetres [m]."""


def rename(state: MapState, edit: Rename, fitting: Fitting) -> Done:
    """Give the thing its class."""
    thing = find(edit.of, state, fitting, also=(edit.class_name,))
    if thing.class_name == edit.class_name:
        return Done("already", (thing.instance,), f"it is a {edit.class_name}")
    state.rename(thing.instance, edit.class_name)
    return Done("applied", (thing.instance,))


def delete(state: MapState, edit: Delete, fitting: Fitting) -> Done:
    """Take the name from the thing's surface."""
    thing = find(edit.of, state, fitting)
    state.relabel(state.instance == thing.instance, 0)
    state.remove(thing.instance)
    return Done("applied", reason=f"{thing.name} is gone")


def merge(state: MapState, edit: Merge, fitting: Fitting) -> Done:
    """Give the surface of all of the things to the first one."""
    try:
        found = [find(anchor, state, fitting) for anchor in edit.of]
        if len({thing.instance for thing in found}) != len(found):
            raise Conflict("two of its things are one and the same here: " + ", ".join(thing.name for thing in found))
    except Conflict:
        one = _merged_already(state, edit.of, fitting)
        if one is None:
            raise
        return Done("already", (one.instance,), "they are one thing")
    instances = [thing.instance for thing in found]
    kept, *others = instances
    parts = [state.entities[instance] for instance in instances]
    state.relabel(np.isin(state.instance, others), kept)
    for instance in others:
        state.remove(instance)
    state.entities[kept] = state.entities[kept].model_copy(
        update={
            "confidence": 1.0,
            "observations": max(part.observations for part in parts),
            "segments": tuple(sorted({segment for part in parts for segment in part.segments})),
        }
    )
    return Done("applied", (kept,), "together with " + ", ".join(thing.name for thing in found[1:]))


def _merged_already(state: MapState, anchors: Sequence[Anchor], fitting: Fitting) -> Thing | None:
    """Return the thing that is what the things of the anchors are together, or None.

    Where the anchors say where their surfaces were, most of each must be called that thing: the box of a large thing
    and a small one beside it is much that of the large one alone.
    """
    try:
        whole = find(joint_anchor(anchors), state, fitting)
    except Conflict:
        return None
    if not all(passes(whole, anchor, fitting) for anchor in anchors):
        return None
    for anchor in anchors:
        if anchor.surface and shares(anchor, state, fitting).get(whole.instance, 0.0) < MOSTLY_ONE:
            return None
    return whole


def split(state: MapState, edit: Split, fitting: Fitting) -> Done:
    """Make the surface of the thing that lies in the box a thing of its own."""
    thing = find(edit.of, state, fitting)
    inside = _inside(state, edit.part) & (state.instance == thing.instance)
    count, whole = int(inside.sum()), int((state.instance == thing.instance).sum())
    if count < FEWEST_VERTICES or whole - count < FEWEST_VERTICES:
        owner = _owner(state, upright_box(edit.part), edit.class_name, fitting)
        if owner is not None and owner.instance != thing.instance:
            return Done("already", (thing.instance, owner.instance), "they are two things")
        raise Conflict(f"{count} of the {whole} vertices of {thing.name} lie in its box")
    part = state.new_entity(edit.class_name, state.entities[thing.instance].observations)
    state.relabel(inside, part)
    return Done("applied", (thing.instance, part))


def add(state: MapState, edit: Add, fitting: Fitting) -> Done:
    """Name the unnamed surface in the box, or draw the box."""
    box = upright_box(edit.box)
    owner = _owner(state, box, edit.class_name, fitting)
    if owner is not None:
        return Done("already", (owner.instance,), f"a {edit.class_name} is there")
    if edit.surface == "box":
        new = state.new_entity(edit.class_name, 0)
        state.add_surface(*box_surface(box, state.voxel_size), new)
        return Done("applied", (new,))
    unnamed = _inside(state, edit.box) & (state.instance == 0)
    if unnamed.sum() < FEWEST_VERTICES:
        others = [thing.name for thing in state.things() if fitting.overlap(box, thing.box) >= fitting.minimum_overlap]
        there = f"; {others[0]} lies there" if others else ""
        raise Conflict(f"{int(unnamed.sum())} vertices without a name lie in its box{there}")
    new = state.new_entity(edit.class_name, 0)
    state.relabel(unnamed, new)
    return Done("applied", (new,))


def set_gravity(state: MapState, edit: SetGravity, fitting: Fitting) -> Done:
    """Turn the map about the middle of the places until the surface there is level."""
    places = np.array(edit.level)
    surface = state.surface.vertices.astype(float)
    tree = cKDTree(surface)
    far, _ = tree.query(places)
    if far.max() > fitting.reach:
        x, y, z = places[int(np.argmax(far))]
        raise Conflict(f"at ({x:.2f}, {y:.2f}, {z:.2f}) m is no surface")
    means = np.array([surface[near].mean(axis=0) for near in tree.query_ball_point(places, fitting.reach)])
    middle = means.mean(axis=0)
    _, spread, axes = np.linalg.svd(means - middle, full_matrices=False)
    if spread[1] < NARROWEST:
        raise Conflict("its places lie nearly on one line: three corners of the surface say how it lies")
    normal = axes[2] * (1.0 if axes[2][2] >= 0 else -1.0)
    tilt = float(np.degrees(np.arccos(np.clip(normal[2], -1.0, 1.0))))
    if tilt > STEEPEST:
        raise Conflict(f"the surface there is {tilt:.0f} degrees from level: which side of it is up?")
    if tilt < LEVEL_ENOUGH:
        return Done("already", reason="it is level")
    rotation = rotation_between(normal, np.array([0.0, 0.0, 1.0]))
    state.turn(transform_from(rotation, middle - rotation @ middle))
    return Done("applied", reason=f"turned by {tilt:.1f} degrees")


def set_floor(state: MapState, edit: SetFloor, fitting: Fitting) -> Done:
    """Draw the floor below the whole map. Surface that was called floor belongs to it where it is as high; elsewhere it
    loses its name."""
    height = edit.at[2]
    floors = [thing for thing in state.things() if thing.class_name == FLOOR]
    if (
        len(floors) == 1
        and abs(top(floors[0].box) - height) < BOX_TOLERANCE
        and not state.entities[floors[0].instance].observations
    ):
        return Done("already", (floors[0].instance,), "it is there")
    named = state.surface.vertices[state.instance > 0] if (state.instance > 0).any() else state.surface.vertices
    if not len(named):
        raise Conflict("the map is empty")
    low, high = named.min(axis=0), named.max(axis=0)
    new = state.new_entity(FLOOR, 0)
    for thing in floors:
        own = state.instance == thing.instance
        near = np.abs(state.surface.vertices[:, 2] - height) <= fitting.reach
        state.relabel(own & near, new)
        state.relabel(own & ~near, 0)
        state.remove(thing.instance)
    size = np.array([*np.maximum(high[:2] - low[:2], THICKNESS), THICKNESS])
    center = np.array([*(low[:2] + high[:2]) / 2, height - THICKNESS / 2])
    slab = gravity_aligned_box(center, size, 0.0)
    state.add_surface(*box_surface(slab, max(state.voxel_size, FLOOR_STEP)), new)
    before = ", ".join(thing.name for thing in floors)
    return Done("applied", (new,), f"in place of {before}" if before else "")


def _inside(state: MapState, where: UprightBox) -> np.ndarray:
    """Return (V,) bool: which vertices of the map lie in a box."""
    return points_in_box(upright_box(where), state.surface.vertices, BOX_TOLERANCE)


def _owner(state: MapState, box: Box, class_name: str, fitting: Fitting) -> Thing | None:
    """Return the thing of the class that fills the box best, if it fits it."""
    fits = [(fitting.overlap(box, t.box), t) for t in state.things() if t.class_name == class_name]
    overlap, thing = max(fits, key=lambda pair: (pair[0], -pair[1].instance), default=(0.0, None))
    return thing if overlap >= fitting.minimum_overlap else None


def box_surface(box: Box, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the six faces of a box as vertices (N, 3) [m] and triangles (F, 3) that look outwards, with edges of about
    `spacing` [m], but at most MOST_STEPS along an edge."""
    size = np.asarray(box.size)
    steps = np.clip(np.ceil(size / spacing), 1, MOST_STEPS).astype(int)
    vertices, faces, first = [], [], 0
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        along, across = np.linspace(-0.5, 0.5, steps[u] + 1), np.linspace(-0.5, 0.5, steps[v] + 1)
        for side in (-0.5, 0.5):
            grid = np.full((len(along), len(across), 3), side)
            grid[..., u], grid[..., v] = along[:, None], across[None, :]
            number = first + np.arange(grid[..., 0].size).reshape(len(along), len(across))
            a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
            quads = (a, b, c, d) if side > 0 else (a, d, c, b)
            flat = [corner.ravel() for corner in quads]
            faces += [np.column_stack([flat[0], flat[1], flat[2]]), np.column_stack([flat[0], flat[2], flat[3]])]
            vertices.append(grid.reshape(-1, 3))
            first += grid[..., 0].size
    local = np.concatenate(vertices) * size
    return local @ box_rotation(box).T + np.asarray(box.center), np.concatenate(faces)


MAP_EDITS: Table[MapState] = {
    Rename: rename,
    Delete: delete,
    Merge: merge,
    Split: split,
    Add: add,
    SetGravity: set_gravity,
    SetFloor: set_floor,
}
