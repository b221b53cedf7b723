"""The kinematic tree as the state of a task: who stands on whom, joint values, what is held; predicted and observed."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile
from scenewright.schemas.plan import BodyMatch, TreeDifference
from scenewright.stages.kit.motion.doors import is_closed, is_open
from scenewright.stages.kit.simulation.carriers import HAND, NOTHING, carrier
from scenewright.stages.kit.simulation.world import PhysicsWorld
from scenewright.stages.plan.action import action_named
from scenewright.stages.plan.believed_tree import TreeState
from scenewright.stages.plan.refinement import Step
from scenewright.stages.plan.updated_graph import update_graph
from scenewright.stages.plan.world_model import WorldModel

MOVED = 0.05
"""Things that moved less than this keep their place in the graph [m]."""


def start_state(model: WorldModel) -> TreeState:
    """Return what is believed at the beginning."""
    movable = [name for name, record in model.records.items() if record.carriable]
    joints = {
        joint.name: model.joint_value(name, joint.name)
        for name, record in model.records.items()
        for joint in record.joints
    }
    parents = {name: model.records[name].parent or SCENE_NODE for name in movable}
    return TreeState(parents, {name: model.pose(name) for name in movable}, joints)


def after_step(state: TreeState, step: Step) -> TreeState:
    """Return the state after a step of the plan: what is carried takes along what stands on it."""
    if step.manipulation is None:
        return state
    return action_named(step.name).predicted(state, step.arguments, step.manipulation)


def observed_state(
    world: PhysicsWorld, matches: dict[str, BodyMatch], joint_names: dict[str, str], held: str | None
) -> TreeState:
    """Return the state of a physics world: carriers are read off the contacts of the last step.

    The carrier of a thing is the body whose contacts push it upwards most; `held` (a body of the world) is the hand's.
    Bodies that no planned body was taken for are called `room:<name>`.
    """
    planned = {match.matched: name for name, match in matches.items() if match.matched is not None}
    parents, poses = {}, {}
    for name, match in matches.items():
        if match.matched is None or not world.bodies[match.matched].record.carriable:
            continue
        poses[name] = world.pose(match.matched)
        below = carrier(world, match.matched)
        parents[name] = (
            HAND if match.matched == held else NOTHING if below is None else planned.get(below, f"room:{below}")
        )
    joints = {}
    for joint, room_joint in joint_names.items():
        body = next(name for name, entry in world.bodies.items() if room_joint in entry.joints)
        joints[joint] = world.joint_value(body, room_joint)
    return TreeState(parents, poses, joints, planned.get(held) if held is not None else None)


def tree_differences(
    action: int, expected: TreeState, observed: TreeState, model: WorldModel
) -> tuple[TreeDifference, ...]:
    """Return where an observed state is not as expected: carriers of things, doors that are open or shut."""
    differences = []
    for name, parent in sorted(observed.parents.items()):
        if expected.parents.get(name, parent) != parent:
            differences.append(
                TreeDifference(action=action, node=name, expected=expected.parents[name], observed=parent)
            )
    for record in model.records.values():
        for joint in record.joints:
            if joint.name not in observed.joints:
                continue
            words = [
                "open"
                if is_open(joint, state.joints[joint.name])
                else "closed"
                if is_closed(joint, state.joints[joint.name])
                else "between"
                for state in (expected, observed)
            ]
            if words[0] != words[1]:
                differences.append(TreeDifference(action=action, node=joint.name, expected=words[0], observed=words[1]))
    return tuple(differences)


def graph_of_state(
    graph: ContactGraphFile, start: TreeState, state: TreeState, believed: TreeState, model: WorldModel
) -> ContactGraphFile:
    """Return the planned scene's graph with what is different in a state from the start, in the same world.

    Poses move along with the change since `start`, from where they are `believed` to be. What the hand holds hangs on
    the scene's root, and the graph says `held`.
    """
    nodes = {node.id for node in graph.nodes}
    moved, parents = {}, {}
    for name, pose in state.poses.items():
        change = pose @ np.linalg.inv(start.poses[name])
        if np.linalg.norm(pose[:3, 3] - start.poses[name][:3, 3]) > MOVED:
            moved[name] = (believed.poses[name], change @ believed.poses[name])
        parent = SCENE_NODE if state.parents[name] == HAND else state.parents[name]
        if state.parents[name] != start.parents[name] and parent in nodes:
            parents[name] = (parent, _relation(model, parent))
    joints: dict[str, dict[str, float]] = {}
    for name, record in model.records.items():
        values = {
            joint.name.removeprefix(f"{name}__"): round(state.joints[joint.name], 6)
            for joint in record.joints
            if joint.name in state.joints
        }
        if values:
            joints[name] = values
    updated = update_graph(graph, moved, parents, joints)
    if state.held is None:
        return updated
    return updated.model_copy(update={"graph": {**updated.graph, "held": state.held}})


def _relation(model: WorldModel, parent: str) -> str:
    """`contains` for furniture that hides what stands on its regions behind doors, else `supports`."""
    record = model.records.get(parent)
    return "contains" if record is not None and record.contains and record.joints else "supports"
