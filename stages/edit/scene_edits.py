"""Edits of a CAD scene: which model stands for a thing and where, and what of it moves, as a person says."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.cad_library import CadModel
from scenewright.schemas.cad_scene import CadCandidate, JointEvidence, Replacement
from scenewright.schemas.contact_graph import GraphNode
from scenewright.schemas.edits import AddJoint, ChooseModel, JointAnchor, Mark, Move, RemoveJoint, SetJoint
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.edit.anchoring import MILLIMETRES, Conflict, Fitting, find
from scenewright.stages.edit.applying import Done, Table
from scenewright.stages.edit.graph_edits import and_below, mark, relink
from scenewright.stages.edit.joint_making import with_limits, with_new_joint
from scenewright.stages.edit.scene_state import SceneState, about
from scenewright.stages.kit.formats.cad_models import load_visual_parts, part_transforms, read_model
from scenewright.stages.kit.geometry.boxes import bottom, box_yaw
from scenewright.stages.kit.geometry.transforms import transform_from_yaw

SAME_PLACE, SAME_ANGLE = 1e-3, math.radians(0.1)
"""A thing that is this near to where an edit wants it is there already [m, rad]."""
JOINT_REACH = 0.25
"""The middle of what a joint moves is at most this far from where the edit says [m] ..."""
JOINT_CLEAR = 0.6
"""... and nearer than this share of the distance of the next one."""
JOINT_ANGLE = math.radians(25.0)
"""Two joints are the same one when their axes differ by no more than this [rad]. By eye."""


def choose_model(state: SceneState, edit: ChooseModel, fitting: Fitting) -> Done:
    """Let another model stand for the thing, or its own mesh."""
    place = find(edit.of, state, fitting).instance
    node = state.graph.nodes[place]
    if node.node_type == "layout":
        raise Conflict(f"{node.id} is part of the building: no model stands for it")
    if node.model_id == edit.model:
        return Done("already", (place,), "its own mesh does" if edit.model is None else f"it is {edit.model}")
    if edit.model is None:
        _keep_mesh(state, node)
        return Done("applied", (place,), f"its own mesh, not {node.model_id}")
    folder = state.model_folder(edit.model)
    if folder is None:
        raise Conflict(f"no model {edit.model!r:.60} is in the scene" + (" or the library" if state.library else ""))
    model, before = read_model(folder), state.replacements.get(node.id)
    seen = [] if before is None else [before.best_single, *before.alternatives]
    known = [candidate for candidate in seen if candidate is not None and candidate.model_id == edit.model]
    replacement = Replacement(
        node=node.id,
        decision="cad",
        reason="a person chose the model",
        chosen=known[0] if known else _fitted(node, model),
        alternatives=() if before is None else before.alternatives,
        joint_evidence={joint.name: JointEvidence(grounds=("user",)) for joint in model.joints} or None,
    )
    state.put_model(node, folder, replacement)
    return Done("applied", (place,), f"not {node.model_id or 'its own mesh'}")


def _keep_mesh(state: SceneState, node: GraphNode) -> None:
    """Let the mesh of the map stand for a node. Raises Conflict when nobody gave the map."""
    file = None if state.map_root is None or node.mesh is None else state.map_root / node.mesh
    if file is None or not file.is_file():
        raise Conflict(f"the mesh of {node.id} is in the panoptic map: give that too")
    state.meshes[node.id] = file
    state.replacements[node.id] = Replacement(
        node=node.id, decision="mesh", reason="a person says that no model stands for it"
    )
    gone: dict[str, object] = {"model_id": None, "world_from_model": None, "scale": None, "joints": {}, "planes": ()}
    state.replace_node(node.model_copy(update={**gone, "box": node.box_observed or node.box}))
    relink(state, node.id)


def _fitted(node: GraphNode, model: CadModel) -> CadCandidate:
    """Return a model that was never tried where the thing's box is: upright, turned to the sides that are most alike
    (as the former model looks, of both ways), as large as the middle one of its three extents."""
    box = node.box
    assert box is not None  # it was found by it
    low, high = np.array(model.states[0].box_minimum), np.array(model.states[0].box_maximum)
    size, wanted = high - low, np.array(box.size)
    ratios = {turn: wanted[[1, 0, 2] if turn % 2 else [0, 1, 2]] / np.maximum(size, 1e-6) for turn in range(4)}
    former = (
        0.0 if node.world_from_model is None else math.atan2(node.world_from_model[1][0], node.world_from_model[0][0])
    )

    def misfit(turn: int) -> tuple[float, float]:
        yaw = box_yaw(box) + turn * math.pi / 2
        return round(float(np.std(np.log(ratios[turn]))), 6), 1.0 - math.cos(yaw - former)

    turn = min(range(4), key=misfit)
    scale = float(np.median(ratios[turn]))
    pose = transform_from_yaw(box_yaw(box) + turn * math.pi / 2, np.zeros(3))
    middle = scale * np.array([*(0.5 * (low + high)[:2]), low[2]])
    pose[:3, 3] = np.array([*box.center[:2], bottom(box)]) - pose[:3, :3] @ middle
    return CadCandidate(
        model_id=model.id,
        joints={joint.name: 0.0 for joint in model.joints},
        scale=scale,
        world_from_model=as_transform(pose),
        matching_error=0.0,
        alignment_error=0.0,
    )


def move(state: SceneState, edit: Move, fitting: Fitting) -> Done:
    """Put the thing where the person says, alone or with what it carries."""
    place = find(edit.of, state, fitting).instance
    node = state.graph.nodes[place]
    if node.node_type == "layout":
        raise Conflict(f"{node.id} is part of the building: it stays")
    turn = math.radians(edit.turn_degrees)
    if edit.turn_degrees and node.model_id is not None:
        raise Conflict(f"{node.id} is {node.model_id} here: the turn was of its own mesh")
    if edit.heading_degrees is not None:
        if node.model_id != edit.model or node.world_from_model is None:
            raise Conflict(f"{node.id} is {node.model_id or 'its own mesh'} here: the heading was of {edit.model}")
        pose = np.array(node.world_from_model)
        turn = math.radians(edit.heading_degrees) - math.atan2(pose[1, 0], pose[0, 0])
        turn = (turn + math.pi) % (2 * math.pi) - math.pi
    assert node.box is not None  # it was found by it
    motion = about(np.array(node.box.center), turn, np.array(edit.to))
    if math.dist(node.box.center, edit.to) < SAME_PLACE and abs(turn) < SAME_ANGLE:
        return Done("already", (place,), "it is there")
    names = [other.id for other in state.graph.nodes if other.id in and_below(state.graph, node.id)]
    for name in names if edit.carried else [node.id]:
        state.move(name, motion)
    for name in names if edit.carried else [node.id]:
        relink(state, name)
    distance = math.dist(node.box.center, edit.to)
    return Done("applied", (place,), f"by {distance:.2f} m and {math.degrees(turn):.0f} degrees")


def asked_move(node: GraphNode, to: Sequence[float] | None, turn: float) -> dict[str, Any]:
    """Return the fields of a move out of where the middle of a node's box goes [m] (None: it stays) and how far it
    turns [degrees]: the heading that its model then has, or else the turn of its own mesh."""
    assert node.box is not None  # it was found by it
    values: dict[str, Any] = {"to": tuple(round(float(value), MILLIMETRES) for value in to or node.box.center)}
    if turn and node.world_from_model is not None:
        pose = node.world_from_model
        heading = (math.degrees(math.atan2(pose[1][0], pose[0][0])) + turn + 180.0) % 360.0 - 180.0
        values |= {"heading_degrees": round(heading, 2), "model": node.model_id}
    elif turn:
        values["turn_degrees"] = turn
    return values


def joint_anchors(state: SceneState, node: GraphNode) -> dict[str, JointAnchor]:
    """Return joint -> its anchor, for the joints of the model that stands for a node. Raises Conflict without one."""
    model, folder, pose = state.model_of(node)
    parts, closed, scale = load_visual_parts(folder), part_transforms(model, {}), node.scale or 1.0
    anchors = {}
    for joint in model.joints:
        part = closed[joint.part]
        local = np.asarray(parts[joint.part].vertices) @ part[:3, :3].T + part[:3, 3]
        middle = pose[:3, :3] @ (scale * 0.5 * (local.min(axis=0) + local.max(axis=0))) + pose[:3, 3]
        axis = pose[:3, :3] @ np.asarray(joint.axis, dtype=float)
        anchors[joint.name] = JointAnchor(type=joint.type, axis=_rounded(axis), middle=_rounded(middle))
    return anchors


def _rounded(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 3) for value in values)
    return (x, y, z)


def _joint(state: SceneState, node: GraphNode, at: JointAnchor) -> Joint:
    """Return the joint of a node that an anchor means. Raises Conflict."""
    here = joint_anchors(state, node)
    model = state.model_of(node)[0]
    far = sorted(
        (math.dist(anchor.middle, at.middle), name)
        for name, anchor in here.items()
        if anchor.type == at.type and _angle(anchor.axis, at.axis) <= JOINT_ANGLE
    )
    if not far or far[0][0] > JOINT_REACH:
        raise Conflict(f"{node.id} ({model.id}) has no {at.type} joint there")
    if len(far) > 1 and far[0][0] > JOINT_CLEAR * far[1][0]:
        raise Conflict(f"{node.id}: two joints fit, {far[0][1]} and {far[1][1]}")
    return next(joint for joint in model.joints if joint.name == far[0][1])


def _angle(a: tuple[float, float, float], b: tuple[float, float, float]) -> float:
    """Return the angle between two directions [rad]."""
    length = math.hypot(*a) * math.hypot(*b)
    return math.acos(max(-1.0, min(1.0, float(np.dot(a, b)) / length))) if length > 0 else math.pi


def _with_evidence(state: SceneState, node: GraphNode, joint: str, *, moves: bool) -> bool:
    """Say of a joint that it moves because a person says so, or that it does not; whether that changed anything."""
    before, model = state.replacements[node.id], state.model_of(node)[0]
    known = before.joint_evidence or {entry.name: JointEvidence(grounds=("user",)) for entry in model.joints}
    entry = known.get(joint, JointEvidence())
    others = tuple(ground for ground in entry.grounds if ground != "user")
    after = entry.model_copy(update={"grounds": ("user", *others) if moves else ()})
    state.replacements[node.id] = before.model_copy(update={"joint_evidence": {**known, joint: after}})
    return (not entry.grounds) == moves


def set_joint(state: SceneState, edit: SetJoint, fitting: Fitting) -> Done:
    """Believe the joint, and give it the range and value that the person says."""
    place = find(edit.of, state, fitting).instance
    node = state.graph.nodes[place]
    joint = _joint(state, node, edit.at)
    lower = joint.lower if edit.lower is None else edit.lower
    upper = joint.upper if edit.upper is None else edit.upper
    value = node.joints.get(joint.name, 0.0) if edit.value is None else edit.value
    if lower >= upper:
        raise Conflict(f"{joint.name}: {lower:.3g} to {upper:.3g} is not a range")
    if edit.value is not None and not lower <= value <= upper:
        raise Conflict(f"{joint.name}: {value:.3g} is not within {lower:.3g} to {upper:.3g}")
    value = min(max(value, lower), upper)
    changed = _with_evidence(state, node, joint.name, moves=True)
    if (lower, upper) != (joint.lower, joint.upper):
        with_limits(state, node, joint.name, lower, upper)
        node, changed = state.graph.nodes[place], True
    if value != node.joints.get(joint.name, 0.0):
        changed, replacement = True, state.replacements[node.id]
        assert replacement.chosen is not None
        chosen = replacement.chosen.model_copy(update={"joints": {**node.joints, joint.name: value}})
        folder = state.model_of(node)[1]
        state.put_model(node, folder, replacement.model_copy(update={"chosen": chosen}))
    return Done("applied" if changed else "already", (place,), f"{joint.name} moves")


def remove_joint(state: SceneState, edit: RemoveJoint, fitting: Fitting) -> Done:
    """Hold the part where it is."""
    place = find(edit.of, state, fitting).instance
    node = state.graph.nodes[place]
    joint = _joint(state, node, edit.at)
    changed = _with_evidence(state, node, joint.name, moves=False)
    return Done("applied" if changed else "already", (place,), f"{joint.name} does not move")


def add_joint(state: SceneState, edit: AddJoint, fitting: Fitting) -> Done:
    """Cut the part out of the thing's model or mesh, and hang it on a joint."""
    place = find(edit.of, state, fitting).instance
    node = state.graph.nodes[place]
    if node.node_type == "layout":
        raise Conflict(f"{node.id} is part of the building: nothing of it moves")
    if edit.lower >= edit.upper or not math.hypot(*edit.axis) > 1e-6:
        raise Conflict("its range or its axis is none")
    name = with_new_joint(state, node, edit)
    return Done("applied", (place,), f"{name} moves")


SCENE_EDITS: Table[SceneState] = {
    ChooseModel: choose_model,
    Move: move,
    SetJoint: set_joint,
    RemoveJoint: remove_joint,
    AddJoint: add_joint,
    Mark: mark,
}
