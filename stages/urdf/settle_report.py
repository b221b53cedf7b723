"""The settle test: is a scene still the same after it was let go, and can its doors and drawers be opened?"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scenewright.schemas.interactive_scene import SettledBody, SettleFile
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.geometry.transforms import quaternion_of
from scenewright.stages.kit.simulation.engine import engine
from scenewright.stages.kit.simulation.margins import is_marginal
from scenewright.stages.kit.simulation.world import PhysicsWorld, load_scene
from scenewright.stages.urdf.joint_sweep import JointRange, sweep_joints
from scenewright.stages.urdf.motions import MOVED_LIMIT, TURNED_LIMIT, WATCHED, BodyMotion, gone, motion_of, watched
from scenewright.stages.urdf.scene_penetration import Overlap, resting_overlaps

Verdict = Literal["ok", "unsettled", "penetrating", "nothing_movable"]
"""Outcome of a scene that was let go."""
SECONDS = 3.0
"""Simulated time that a scene is given to come to rest [s]."""
SEEN_MOVE = 1e-3
"""A body that never goes further is shown standing still [m]."""
COLLISION_DEPTH = 0.005
"""Two bodies collide when they lie deeper than this in each other at rest [m]."""


@dataclass(frozen=True)
class SettleReport:
    """What the settle test found of one scene; distances in metres, angles in radians."""

    seconds: float
    bodies: tuple[BodyMotion, ...]
    """Movable bodies, in the order of scene.json."""
    joints: tuple[JointRange, ...]
    """Moving joints of all bodies."""
    overlaps: tuple[Overlap, ...]
    """Pairs of bodies that lie in each other as the scene was written, before it was let go, deepest first."""

    @property
    def unsettled(self) -> tuple[BodyMotion, ...]:
        """Movable bodies that did not stay."""
        return tuple(body for body in self.bodies if not body.stays)

    @property
    def blocked(self) -> tuple[JointRange, ...]:
        """Joints that meet something at the start of their motion."""
        return tuple(joint for joint in self.joints if not joint.free_at_start)

    @property
    def verdict(self) -> Verdict:
        """What is gravest: something does not stay or a joint is blocked at the start, bodies lie in each other, or
        there is nothing that could move, so that to stay means nothing."""
        if self.unsettled or self.blocked:
            return "unsettled"
        if self.collisions:
            return "penetrating"
        return "ok" if self.bodies or self.joints else "nothing_movable"

    @property
    def settled(self) -> bool:
        """Whether something can move, every movable body stays, no joint is blocked at the start, and no two bodies
        lie more than 5 mm in each other."""
        return self.verdict == "ok"

    @property
    def reason(self) -> str:
        """Say the verdict in one sentence."""
        if self.verdict == "nothing_movable":
            return "no body is free to move and no joint moves, so that staying says nothing"
        if self.verdict == "ok":
            return f"{len(self.bodies)} movable bodies stay, {len(self.joints)} joints are free"
        parts = []
        if self.unsettled:
            worst = max(self.unsettled, key=lambda body: (body.fell_through, body.moved))
            fate = "falls through the floor" if worst.fell_through else f"moves {1000 * worst.moved:.0f} mm"
            parts.append(
                f"{len(self.unsettled)} of {len(self.bodies)} movable bodies do not stay ({worst.name} {fate})"
            )
        if self.blocked:
            parts.append(f"{len(self.blocked)} of {len(self.joints)} joints are blocked ({self.blocked[0].joint})")
        if self.collisions:
            pair = self.collisions[0]
            parts.append(
                f"{len(self.collisions)} pairs lie more than {1000 * COLLISION_DEPTH:.0f} mm in each other "
                f"({pair.first} {1000 * pair.depth:.0f} mm in {pair.second})"
            )
        return ", ".join(parts)

    @property
    def margins(self) -> dict[str, float]:
        """Body, joint, or pair -> margin of what is said of it, of those within reach of their thresholds."""
        found = {body.name: body.margin for body in self.bodies} | {joint.joint: joint.margin for joint in self.joints}
        found |= {f"{pair.first_link} in {pair.second_link}": pair.margin for pair in self.overlaps}
        return {name: margin for name, margin in found.items() if margin is not None}

    @property
    def margin(self) -> float | None:
        """Margin of the verdict: all that speaks for it would have to be otherwise, or one thing that is graver; None
        where neither is within reach."""
        grave = [(not body.stays, body.margin) for body in self.bodies]
        grave += [(not joint.free_at_start, joint.margin) for joint in self.joints]
        pairs = [(pair.depth > COLLISION_DEPTH, pair.margin) for pair in self.overlaps]
        if self.verdict == "unsettled":
            return _margin_of_all(grave)
        turning = [margin for _, margin in grave if margin is not None]
        if self.verdict == "penetrating":
            turning += [margin for margin in [_margin_of_all(pairs)] if margin is not None]
        else:
            turning += [margin for _, margin in pairs if margin is not None]
        return min(turning, default=None)

    @property
    def marginal(self) -> tuple[str, ...]:
        """Bodies, joints and pairs of which the contrary is nearly as likely."""
        return tuple(name for name, margin in self.margins.items() if is_marginal(margin))

    @property
    def max_penetration_mm(self) -> float:
        """Depth of the deepest pair [mm], 0 when none share space."""
        return 1000.0 * max((overlap.depth for overlap in self.overlaps), default=0.0)

    @property
    def collisions(self) -> tuple[Overlap, ...]:
        """Pairs deeper than 5 mm (`COLLISION_DEPTH`)."""
        return tuple(overlap for overlap in self.overlaps if overlap.depth > COLLISION_DEPTH)

    def as_json(self) -> dict[str, Any]:
        """Return everything as plain values for JSON."""
        return {
            "verdict": self.verdict,
            "reason": self.reason,
            "settled": self.settled,
            "margin": self.margin,
            "marginal": list(self.marginal),
            "seconds": self.seconds,
            "max_penetration_mm": self.max_penetration_mm,
            "collisions": len(self.collisions),
            "bodies": [_plain(body) for body in self.bodies],
            "joints": [asdict(joint) | {"free_at_start": joint.free_at_start} for joint in self.joints],
            "overlaps": [asdict(overlap) for overlap in self.overlaps],
        }


def _margin_of_all(entries: list[tuple[bool, float | None]]) -> float | None:
    """Return the margin of a verdict that stands until all that fails (True) no longer does; None where one is far."""
    margins = [margin for fails, margin in entries if fails]
    known = [margin for margin in margins if margin is not None]
    return max(known) if known and len(known) == len(margins) else None


def _plain(body: BodyMotion) -> dict[str, Any]:
    values = asdict(replace(body, poses=(), times=(), centers=()))
    for unsaid in ("poses", "times", "centers", "leaves"):
        del values[unsaid]
    return values | {"stays": body.stays}


def settle_report(
    scene_folder: Path,
    seconds: float = SECONDS,
    *,
    moved_limit: float = MOVED_LIMIT,
    turned_limit: float = TURNED_LIMIT,
) -> SettleReport:
    """Return what the settle test finds of an interactive scene (or the `room/` of a ground truth). Writes nothing.

    The scene is loaded into Bullet as scene.json says: static bodies fixed, movable ones free and never put to sleep,
    joints at their values. First the depth to which bodies lie in each other is measured and every joint moved alone
    through its range (`joint_sweep`); then the world runs for `seconds` [s] under gravity.

    Raises BadInput for a scene that cannot be read or loaded.
    """
    with load_scene(Path(scene_folder)) as world:
        overlaps = tuple(resting_overlaps(world, smallest=1e-4))
        joints = tuple(sweep_joints(world))
        bodies = tuple(_let_go(world, seconds, moved_limit, turned_limit))
    return SettleReport(seconds, bodies, joints, overlaps)


def free_bodies(world: PhysicsWorld) -> list[str]:
    """Forbid the movable bodies of a world to fall asleep, so that what creeps is seen, and return their names."""
    movable = [name for name, body in world.bodies.items() if body.record.movable]
    for name in movable:
        engine.changeDynamics(
            world.bodies[name].body_id,
            -1,
            activationState=engine.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=world.client,
        )
    return movable


def _let_go(world: PhysicsWorld, seconds: float, moved_limit: float, turned_limit: float) -> list[BodyMotion]:
    ground = _ground(world)
    movable = free_bodies(world)
    frames: dict[str, list[np.ndarray]] = {name: [] for name in movable}

    def look() -> dict[str, np.ndarray]:
        for name in movable:
            frames[name].append(world.pose(name))
        return {name: world.center_of_mass(name) for name in movable}

    times, looks = watched(world.step, look, seconds, world.time_step)
    return [
        motion_of(
            name,
            times,
            [seen[name] for seen in looks],
            fell_through=bool(world.bounds(name)[1][2] < ground),
            moved_limit=moved_limit,
            turned_limit=turned_limit,
            poses=tuple(frames[name]),
        )
        for name in movable
    ]


def settle_file(report: SettleReport) -> SettleFile:
    """Return how the test went, as it is kept: to tenths of a millimetre."""
    count = max((len(body.poses) for body in report.bodies), default=0)
    times = tuple(round(min(k * WATCHED, report.seconds), 4) for k in range(count))
    troubles = [f"{pair.first} lies {1000 * pair.depth:.0f} mm in {pair.second}" for pair in report.collisions]
    troubles += [f"{joint.joint} meets {joint.hit_link} at the start of its motion" for joint in report.blocked]
    return SettleFile(
        times=times,
        bodies=tuple(_settled(body) for body in report.bodies),
        troubles=tuple(troubles),
        verdict=report.verdict,
        reason=report.reason,
        margin=None if report.margin is None else round(report.margin, 2),
        margins={name: round(margin, 2) for name, margin in report.margins.items()},
    )


def _settled(body: BodyMotion) -> SettledBody:
    far = max((gone(body.poses[0], pose)[0] for pose in body.poses), default=0.0)
    shown = body.poses if far > SEEN_MOVE or not body.stays else ()
    rows = [np.round([*pose[:3, 3], *quaternion_of(pose)], 4).tolist() for pose in shown]
    return SettledBody(
        name=body.name,
        moved=round(body.moved, 4),
        turned=round(body.turned, 4),
        leaves=None if body.stays else body.leaves,
        fell_through=body.fell_through,
        poses=tuple(tuple(row) for row in rows),
    )


def _ground(world: PhysicsWorld) -> float:
    """Return the height under which nothing may end [m]: the lowest top of a floor, else the bottom of all that is
    fixed."""
    vocabulary = load_vocabulary()
    fixed = [body for body in world.bodies.values() if not body.record.movable]
    floors = [body.name for body in fixed if vocabulary.by_name(body.record.class_name).name == "floor"]
    if floors:
        return min(float(world.bounds(name)[1][2]) for name in floors)
    return min((float(world.bounds(body.name)[0][2]) for body in fixed), default=-np.inf)
