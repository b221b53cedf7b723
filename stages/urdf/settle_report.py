"""The settle test: is a scene still the same after it was let go, and can its doors and drawers be opened?"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from schemas.vocabulary import load_vocabulary
from stages.kit.simulation.engine import engine
from stages.kit.simulation.world import PhysicsWorld, load_scene
from stages.urdf.joint_sweep import JointRange, sweep_joints
from stages.urdf.scene_penetration import Overlap, resting_overlaps

Verdict = Literal["ok", "unsettled", "penetrating", "nothing_movable"]
"""Outcome of a scene that was let go."""
SECONDS = 3.0
MOVED_LIMIT = 0.01
"""A movable body that moves further has not stayed [m]."""
TURNED_LIMIT = np.radians(2.0)
"""A movable body that turns further has not stayed [rad]."""
COLLISION_DEPTH = 0.005
"""Two bodies collide when they lie deeper than this in each other at rest [m]."""


@dataclass(frozen=True)
class BodyMotion:
    """What became of one movable body."""

    name: str
    moved: float
    """Distance between where its centre of mass was and where it is [m]."""
    turned: float
    """Angle between how it stood and how it stands [rad]."""
    fell_through: bool
    """Whether all of it ended below the top of the floor (without a floor: below everything that is fixed)."""
    moved_limit: float = MOVED_LIMIT
    turned_limit: float = TURNED_LIMIT

    @property
    def stays(self) -> bool:
        """Whether it stayed where it was, within the limits."""
        return self.moved <= self.moved_limit and self.turned <= self.turned_limit and not self.fell_through


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
            "seconds": self.seconds,
            "max_penetration_mm": self.max_penetration_mm,
            "collisions": len(self.collisions),
            "bodies": [asdict(body) | {"stays": body.stays} for body in self.bodies],
            "joints": [asdict(joint) | {"free_at_start": joint.free_at_start} for joint in self.joints],
            "overlaps": [asdict(overlap) for overlap in self.overlaps],
        }


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
    before = {name: world.center_of_mass(name) for name in movable}
    world.step(round(seconds / world.time_step))
    motions = []
    for name in movable:
        after = world.center_of_mass(name)
        motions.append(
            BodyMotion(
                name,
                moved=float(np.linalg.norm(after[:3, 3] - before[name][:3, 3])),
                turned=float(Rotation.from_matrix(before[name][:3, :3].T @ after[:3, :3]).magnitude()),
                fell_through=bool(world.bounds(name)[1][2] < ground),
                moved_limit=moved_limit,
                turned_limit=turned_limit,
            )
        )
    return motions


def _ground(world: PhysicsWorld) -> float:
    """Return the height under which nothing may end [m]: the lowest top of a floor, else the bottom of all that is
    fixed."""
    vocabulary = load_vocabulary()
    fixed = [body for body in world.bodies.values() if not body.record.movable]
    floors = [body.name for body in fixed if vocabulary.by_name(body.record.class_name).name == "floor"]
    if floors:
        return min(float(world.bounds(name)[1][2]) for name in floors)
    return min((float(world.bounds(body.name)[0][2]) for body in fixed), default=-np.inf)
