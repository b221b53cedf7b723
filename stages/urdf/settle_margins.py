"""How sure the settle test's verdicts are: what is near a threshold is let go, moved or measured eight times more, from
poses a tenth of a millimetre apart (`kit/simulation/margins.py`). What is far from it costs nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scenewright.stages.kit.simulation.margins import RUNS, margin, perturbed
from scenewright.stages.kit.simulation.world import PhysicsWorld, load_scene, read_scene_bodies
from scenewright.stages.urdf.joint_sweep import HIT_DEPTH, JointRange, sweep_joint
from scenewright.stages.urdf.motions import WATCHED, BodyMotion, gone
from scenewright.stages.urdf.resting import STILL
from scenewright.stages.urdf.scene_penetration import Overlap, pair_depth
from scenewright.stages.urdf.settle_report import COLLISION_DEPTH, SettleReport, free_bodies

REACH = 2.0
"""A move is near its limit when it is less than twice as large or small: only a spread of half of a move could make one
marginal that is farther, and a cup that rocks spreads by a third of it."""
LOOKS = 4
"""Runs end early when nothing moved in this many looks (`WATCHED`): most things rest after half a second."""
DEPTH_REACH = 0.001
"""A depth is near its limit when it is closer [m]: the runs change depths by some 0.1 mm."""
COST, SHORTEST = 0.5, 0.5
"""All runs together take this share of the settle test's own simulation, as far as each still lasts so long [s]."""
BESIDE = 0.05
"""What comes closer [m] to a body may touch it while that moves."""


def with_margins(report: SettleReport, scene_folder: Path) -> SettleReport:
    """Return the report of a scene with the margins of what is near a threshold. Writes nothing. Raises BadInput."""
    bodies = [body for body in report.bodies if body_is_near(body)]
    joints = [joint for joint in report.joints if _joint_is_near(joint)]
    pairs = [pair for pair in report.overlaps if abs(pair.depth - COLLISION_DEPTH) < DEPTH_REACH]
    if not (bodies or joints or pairs):
        return report
    random = np.random.default_rng(0)
    with load_scene(scene_folder) as world:
        of_joints = {joint: _joint_margin(world, joint, random) for joint in joints}
        of_pairs = {pair: _pair_margin(world, pair, random) for pair in pairs}
        involved = _involved(world, {body.name for body in bodies})
    share = len(involved & {body.name for body in report.bodies}) / max(len(report.bodies), 1)
    seconds = min(report.seconds, max(SHORTEST, COST * report.seconds / (RUNS * share))) if bodies else 0.0
    of_bodies = _body_margins(scene_folder, involved, bodies, seconds, random) if bodies else {}
    return replace(
        report,
        bodies=tuple(replace(body, margin=of_bodies.get(body.name)) for body in report.bodies),
        joints=tuple(replace(joint, margin=of_joints.get(joint)) for joint in report.joints),
        overlaps=tuple(replace(pair, margin=of_pairs.get(pair)) for pair in report.overlaps),
    )


def _shares(body: BodyMotion) -> tuple[float, float]:
    """Return how far the body moved and turned, in units of the limits."""
    return (
        body.moved / body.moved_limit if body.moved_limit > 0.0 else np.inf,
        body.turned / body.turned_limit if body.turned_limit > 0.0 else np.inf,
    )


def body_is_near(body: BodyMotion) -> bool:
    """Whether what is said of a body could be otherwise: one limit is near, and none is passed by far."""
    shares = _shares(body)
    return not body.fell_through and max(shares) < REACH and max(shares) > 1.0 / REACH


def _joint_is_near(joint: JointRange) -> bool:
    decided = (joint.start_depth > HIT_DEPTH) != joint.free_at_start
    return decided and abs(joint.start_depth - HIT_DEPTH) < DEPTH_REACH


def _joint_margin(world: PhysicsWorld, joint: JointRange, random: np.random.Generator) -> float:
    def depth() -> float:
        return sweep_joint(world, joint.body, joint.joint).start_depth

    return margin(joint.start_depth, HIT_DEPTH, [_near_by(world, joint.body, depth, random) for _ in range(RUNS)])


def _pair_margin(world: PhysicsWorld, pair: Overlap, random: np.random.Generator) -> float:
    def depth() -> float:
        return pair_depth(world, pair)

    return margin(pair.depth, COLLISION_DEPTH, [_near_by(world, pair.first, depth, random) for _ in range(RUNS)])


def _near_by(world: PhysicsWorld, name: str, measured: Callable[[], float], random: np.random.Generator) -> float:
    """Return what is measured with a body a little off its pose, and put it back."""
    pose = np.array(world.bodies[name].record.world_from_body)
    world.set_pose(name, perturbed(pose, random))
    try:
        return measured()
    finally:
        world.set_pose(name, pose)


def _involved(world: PhysicsWorld, names: set[str]) -> set[str]:
    """Return bodies and all that may touch them, what is movable of it in turn."""
    bounds = {name: world.bounds(name) for name in world.bodies}
    involved, fresh = set(names), set(names)
    while fresh:
        beside = {
            other
            for name in fresh
            for other, (low, high) in bounds.items()
            if (low - BESIDE <= bounds[name][1]).all() and (bounds[name][0] <= high + BESIDE).all()
        }
        fresh = {name for name in beside - involved if world.bodies[name].record.movable}
        involved |= beside
    return involved


def _body_margins(
    folder: Path, names: Iterable[str], bodies: list[BodyMotion], seconds: float, random: np.random.Generator
) -> dict[str, float]:
    """Return body -> margin, of those asked for: what is around them is let go with them, the rest of the room not."""
    loaded = {name: entry for name, entry in read_scene_bodies(folder).items() if name in set(names)}
    runs: dict[str, list[tuple[float, float]]] = {body.name: [] for body in bodies}
    for _ in range(RUNS):
        with PhysicsWorld() as world:
            for name, (record, text) in loaded.items():
                world.add_body(record, text)
                if record.movable:
                    world.set_pose(name, perturbed(np.array(record.world_from_body), random))
            before = {name: world.center_of_mass(name) for name in runs}
            _let_rest(world, seconds)
            for name, motions in runs.items():
                motions.append(gone(before[name], world.center_of_mass(name)))
    return {body.name: body_margin(body, runs[body.name]) for body in bodies}


def _let_rest(world: PhysicsWorld, seconds: float) -> None:
    """Let a world run until nothing moves any more, at most for `seconds` [s]."""
    movable, still = free_bodies(world), 0
    for _ in range(round(seconds / WATCHED)):
        world.step(round(WATCHED / world.time_step))
        still = still + 1 if all(max(world.velocity(name)) < STILL for name in movable) else 0
        if still == LOOKS:
            return


def body_margin(body: BodyMotion, runs: list[tuple[float, float]]) -> float:
    """Return the margin of what is said of a body, of how far it moved [m] and turned [rad] in runs beside it."""
    margins = (
        margin(body.moved, body.moved_limit, [moved for moved, _ in runs]),
        margin(body.turned, body.turned_limit, [turned for _, turned in runs]),
    )
    if body.stays:
        return min(margins)
    return max(found for found, share in zip(margins, _shares(body), strict=True) if share > 1.0)
