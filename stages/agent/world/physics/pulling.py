"""Doors and drawers: the handle is looked for, gripped and driven along; what is open is pushed shut.

All that is known of a front is what was seen of it and what the arm's joints felt (`fronts.py`).
"""

from __future__ import annotations

from collections.abc import Iterator
from math import atan2, pi

import numpy as np
from scenewright.stages.agent.senses import Base, Felt, Position
from scenewright.stages.agent.world.physics.before_fronts import (
    away_from,
    bases_before,
    bases_outside,
    before,
    sides_of,
)
from scenewright.stages.agent.world.physics.driving import Driving
from scenewright.stages.agent.world.physics.front_seeing import fronts_seen
from scenewright.stages.agent.world.physics.fronts import PARTS, Front
from scenewright.stages.agent.world.physics.looking import Looking
from scenewright.stages.agent.world.physics.robot_in_room import RobotInRoom, felt
from scenewright.stages.agent.world.physics.seen import Seen
from scenewright.stages.kit.acting.doors import OVERSHOOT, first_along, pushes
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.motion.arcs import Arc, arc_values
from scenewright.stages.kit.motion.arm_motion import ArmPlanner, Tally
from scenewright.stages.kit.motion.doors import (
    ContactPoint,
    body_from_moved,
    closing_direction,
    is_closed,
    is_open,
    open_value,
    push_points,
)
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.kinematics import forward
from scenewright.stages.kit.motion.rrt_connect import SearchSpace
from scenewright.stages.kit.motion.segments import Manipulation, Segment
from scenewright.stages.kit.simulation.robot import base_pose
from scenewright.stages.kit.simulation.shapes import joined, link_shapes

HEIGHT_OF_LOOK = 0.65
"""Share of its height at which a side is looked at; by eye."""
PITCHES = (0.0, 0.5, 0.9)
"""How far the hand comes down to a bar [rad]."""
TILTS, WIDE_TILTS = (0.0, 0.35, -0.35, 0.7, -0.7), ((1.0, 0.0), (-1.0, 0.0), (0.5, -0.5), (-0.5, 0.5))
"""Turns of the hand about the vertical [rad]: where it grips, and from the first to the last where it pushes."""
FINE = 0.02
"""Largest step of a joint between two checks [rad]: a bar is thinner than what the elbow sweeps in a larger one."""
GRIP_OPENING = 0.06
"""Gap of the fingers around a bar before they close [m]: there is little room behind it."""
DEEPER = 0.008
"""Distance of the tool point behind the middle of a bar [m]: held by their ends alone, the fingers slide off it."""
NOTHING_GRIPPED = 0.01
"""Opening of the fingers below which they hold no bar [m]."""
PUSHES = 4
"""Most pushes at one front: something may be in the way of one. By eye."""
NOTICED = 0.1
"""Least angle by which it pays to push a leaf on [rad]; by eye."""
SHARES = (1.0, 0.75, 0.5)
"""Shares of what a door opens to, tried one after the other."""
FAR_OUT = 1.1
"""Share of what a drawer opens to that is tried first: what lies at its back is under the furniture's edge otherwise,
and the hand is wide."""
SAMPLES = 500
"""Most samples of one path search; by eye."""
SEEN_TO = 0.15
"""How well the eyes tell how far a front is open [rad] or [m]."""
HERE = 0.12
"""A base this near to one that is asked for stands there [m]."""
LOOKS_IN = ((0.6, 0.15), (0.6, 0.28), (0.6, 0.02))
"""Base poses from which an open leaf's inside is seen: before the front and to the handle's side [m]."""


class Pulling:
    """The doors of a robot."""

    def __init__(self, robot: RobotInRoom, seen: Seen, looking: Looking, driving: Driving) -> None:
        self._robot, self._seen, self._looking, self._driving = robot, seen, looking, driving

    def pull(self, at: Position, *, opening: bool) -> Felt:
        """Open or close the door or drawer of the furniture at a position."""
        number = self._seen.piece_at(at)
        piece = None if number is None else self._seen.pieces[number]
        step = f"{'open' if opening else 'close'} {piece.label if piece else 'nothing'}"
        if number is None or self._robot.hold is not None:
            self._robot.log.done("pull", step, False, "grasp", "")
            return Felt(False, "out_of_reach")
        name = f"furniture_{number}"
        try:
            value = self._open(name, number) if opening else self._shut(name)
            self._seen.moved(name, value)
            self._check(self._seen.fronts[name], opening)
        except MotionFailed as failed:
            self._robot.draw_in()
            self._robot.log.done("pull", step, False, "grasp", "")
            return felt(failed)
        self._robot.log.done("pull", step, True, "", "")
        if opening:
            self._stand_before(self._seen.fronts[name])
        return Felt(True, furniture=self._seen.piece_seen(number))

    def _check(self, front: Front, opening: bool) -> None:
        joint, value = front.joint, front.value
        if not (is_open(joint, value) if opening else is_closed(joint, value)):
            raise MotionFailed(
                "door_stuck",
                f"the {'drawer' if front.slides else 'door'} stands at {value:.2f} of {joint.upper:.2f}",
                (front.name,),
                {"value": value, "upper": joint.upper},
            )

    # ---- the handle ----

    def _find(self, number: int) -> Front:
        """Return the front of furniture with its handle, looked for from before its sides, those with most room first.
        Raises MotionFailed `no_grasp`."""
        label, fits = self._seen.pieces[number].label, self._seen.obstacles.fits
        looked, sides = 0, sides_of(self._seen.pieces[number].box)
        for middle, normal in sorted(sides, key=lambda side: -self._room_before(*side)):
            pose = next((pose for pose in before(middle, normal) if fits(pose[0], pose[1])), None)
            if pose is not None and self._go(pose, label):
                looked += 1
                front = self._look(number, middle)
                if front is not None:
                    return front
        raise MotionFailed(
            "no_grasp", f"no handle of the {label} was seen from {looked} sides", (label,), {"sides": looked}
        )

    def _room_before(self, middle: np.ndarray, normal: np.ndarray) -> int:
        """Return at how many of 40 distances, 10 cm apart, the base fits before a side."""
        return sum(self._seen.obstacles.fits(*(middle + 0.1 * k * normal)) for k in range(1, 41))

    def _look(self, number: int, middle: np.ndarray | None = None) -> Front | None:
        """Look at the handle of furniture where it was seen before, or at the `middle` (2,) of a side; keep the front,
        if its handle is there."""
        piece, base = self._seen.pieces[number], self._robot.believed
        low, high = piece.box
        known_front = self._seen.fronts.get(f"furniture_{number}")
        if known_front is not None and known_front.value > 0:
            return known_front  # half open, the handle does not tell where the front is
        if known_front is not None:
            at = known_front.middle
        else:
            assert middle is not None
            at = np.array([*middle, HEIGHT_OF_LOOK * high[2]])
        name, surfaces = f"furniture_{number}", self._looking.look_at_front(_position(at))
        if not any(s.label == PARTS[0] for s in surfaces):  # a near look shows no whole panel
            surfaces_close = self._looking.look_at_front(_position(at), close=True)
            surfaces += [s for s in surfaces_close if s.label == PARTS[0]]
        fronts = fronts_seen(name, piece.label, (low, high), surfaces, base)
        if known_front is not None:  # of several, the one that was looked at
            fronts = sorted(fronts, key=lambda f: float(np.linalg.norm(f.middle - at)))[:1]
        elif fronts:
            self._seen.waiting[name] = fronts[1:]
        if fronts:
            self._seen.fronts[name] = fronts[0]
        return fronts[0] if fronts else None

    def _next(self, name: str) -> None:
        """Take the next of several fronts, where one of them is open: it is shut first. Raises MotionFailed."""
        front, waiting = self._seen.fronts.get(name), self._seen.waiting.get(name)
        if front is None or not waiting or not is_open(front.joint, front.value):
            return
        self._seen.moved(name, self._shut(name))
        self._check(self._seen.fronts[name], opening=False)
        self._seen.fronts[name], self._seen.waiting[name] = waiting[0], waiting[1:]

    def _go(self, pose: np.ndarray, label: str) -> bool:
        """Drive to a base pose (3,) before furniture of a class, if the robot does not stand there."""
        present_pose = self._robot.believed
        turn = (pose[2] - present_pose[2] + pi) % (2 * pi) - pi
        if np.hypot(*(pose[:2] - present_pose[:2])) < HERE and abs(turn) < 0.6:
            return True
        base = Base(float(pose[0]), float(pose[1]), float(pose[2]))
        is_drivable = np.isfinite(self._seen.obstacles.way(self._robot.base, (base.x, base.y)))
        return bool(is_drivable) and self._driving.drive(base, f"{label}_0").ok

    # ---- open ----

    def _open(self, name: str, number: int) -> float:
        """Open a front; return how far it is open by the arm's joints. Raises MotionFailed."""
        self._next(name)
        front = self._seen.fronts.get(name) or self._find(number)
        if is_open(front.joint, front.value):
            return front.value  # as it stood when it was first seen
        tally = Tally()
        for base in self._bases(front):
            if self._drag(front, base, tally) is None or not self._go(base, front.label):
                continue
            front = self._look(number) or front  # what was measured from another stop is off by both stops' errors
            motion = self._drag(front, self._robot.believed, tally)
            if motion is not None:
                value = self._carry_out(front, motion)
                return value if front.slides else self._push_on(name, value)
        tally.raise_for(f"open({front.name})", (front.name,))

    def _push_on(self, name: str, value: float) -> float:
        """Push a leaf that came less far than it should on from inside, as long as that gets it on: half open it is in
        the way of base and elbow. Return where it is seen then."""
        for _ in range(PUSHES):
            front = self._seen.moved(name, value)
            end = open_value(front.joint)
            pushed = self._push_toward(front, (end,), Tally()) if value < end - NOTICED else None
            if pushed is None or pushed < value + NOTICED:
                return value if pushed is None else pushed
            value = pushed
        return value

    def _carry_out_push(self, front: Front, motion: Manipulation) -> float:
        """Carry out a push; something behind a leaf may stop it."""
        try:
            return self._carry_out(front, motion)
        except MotionFailed:
            self._robot.draw_in()
            return self._see_opening(front, front.value)

    def _bases(self, front: Front, *, shutting: bool = False) -> Iterator[np.ndarray]:
        """Yield base poses (3,) for a front that the robot can get to: where it stands first, if that is before it."""
        if away_from(front, self._robot.believed) < 1.2:
            yield self._robot.believed.copy()
        for pose in (*(bases_outside(front) if shutting else ()), *bases_before(front)):
            if self._seen.obstacles.fits(pose[0], pose[1]):
                yield pose

    def _drag(self, front: Front, base: np.ndarray, tally: Tally) -> Manipulation | None:
        """Return the motion that grips the handle and opens the front from a base pose (3,), or None (tallied)."""
        planner = self._planner()
        joint = front.joint
        handle = np.array(joint.handle)
        bar = np.array(joint.handle_axis)
        inward = closing_direction(joint, handle)
        tried = (FAR_OUT, *SHARES) if front.slides else SHARES
        shares = tried if front.alone else tried[:-1]  # of several, one that is half open hides the others
        arcs = (
            Arc(front.name, joint, contact, values, np.full(len(values), tilt), roll, -DEEPER, GRIP_OPENING, 0.0)
            for values in (arc_values(front.value, share * open_value(joint)) for share in shares)
            for pitch in PITCHES
            for contact in (ContactPoint(handle, np.array([*(np.cos(pitch) * inward[:2]), -np.sin(pitch)])),)
            for roll in ((0.0, pi) if abs(bar[2]) > 0.5 else (pi / 2, -pi / 2))
            for tilt in TILTS
        )
        return first_along(self._robot.beliefs, self._robot.arm, arcs, (base,), planner, tally)

    def _planner(self) -> ArmPlanner:
        beliefs = self._robot.beliefs
        beliefs.hold(None)
        beliefs.show(self._seen.boxes())
        planner = ArmPlanner(beliefs, self._robot.random, SAMPLES)
        planner.space = SearchSpace(beliefs.chain.lower, beliefs.chain.upper, np.full(len(self._robot.arm), FINE))
        return planner

    def _carry_out(self, front: Front, motion: Manipulation) -> float:
        """Carry out a motion along with a front; return where the arm's joints say that it is then.

        Where the bar is no longer between the fingers, and of a leaf, which swings on, the eyes say it. Raises
        MotionFailed.
        """
        robot = self._robot
        *segments, away, home = motion.segments
        start = next(k for k, segment in enumerate(segments) if segment.label in ("pull", "push"))
        robot.room.world.wake()
        robot.driver.robot.finger_force = robot.description.firm_finger_force
        try:
            value, slipped = self._along(front, segments, start)
        finally:
            robot.driver.robot.finger_force = robot.description.finger_force
        try:
            robot.carry_out((away, home))
        except MotionFailed:
            robot.draw_in()  # it let go already
        robot.driver.wait(0.5)
        if not front.slides or slipped:
            value = self._see_opening(front, value)
        return value

    def _along(self, front: Front, there: list[Segment], start: int) -> tuple[float, bool]:
        """Carry out the segments of which number `start` is the first that moves a front; return where the arm's joints
        say that it is then, and whether the bar slipped out of the fingers."""
        robot = self._robot
        robot.carry_out(tuple(there[:start]))
        before = front.local(self._tool(there[start].path[0, 3:])[None])
        shut = apply(inverse(body_from_moved(front.joint, front.value)), before)[0]
        robot.carry_out(tuple(there[start:]))
        if there[start].label == "pull" and robot.driver.robot.configuration().opening < NOTHING_GRIPPED:
            return front.value, True
        return max(0.0, front.felt(self._tool(robot.driver.measured_arm()), shut)), False

    def _see_opening(self, front: Front, value: float) -> float:
        """Return how far a front is open as seen from here; the `value` that was felt, which is finer, where it is not
        seen or the eyes say about the same."""
        surfaces = self._looking.look_at_front(_position(front.middle))
        panels = [s.points for s in surfaces if s.label in PARTS[1:]]
        if front.alone:
            value_seen = max(0.0, front.value_seen(max(panels, key=len))) if panels else value
        else:  # which of several it is, is told by where it should be
            values = [max(0.0, front.value_seen(points)) for points in panels if front.level_with(points)]
            if front.slides:  # its front may be out of the picture, and its handle behind it
                bars = [s.points for s in surfaces if s.label == PARTS[0] and front.level_with(s.points)]
                value_seen = max([front.value_of_bar(points) for points in bars] + values, default=value)
            else:
                value_seen = min(values, key=lambda seen: abs(seen - value), default=value)
        return value if abs(value_seen - value) < SEEN_TO else value_seen

    def _tool(self, arm: np.ndarray) -> np.ndarray:
        """Return the tool point (3,) of the map for joint values (J,)."""
        robot = self._robot
        pose: np.ndarray = base_pose(robot.believed, robot.description) @ forward(robot.beliefs.chain, arm)
        return pose[:3, 3]

    def _stand_before(self, front: Front) -> None:
        """Drive to where the inside of an open leaf is seen; a drawer's is, from where it was pulled."""
        if front.slides:
            return
        side = -front.joint.axis[2]
        x = front.size[0] / 2
        for away, aside in LOOKS_IN:
            standpoint, handle_point = apply(
                front.map_from_front, np.array([(x + away, side * aside, 0.0), (0.0, 0.0, 0.0)])
            )
            pose = np.array(
                [standpoint[0], standpoint[1], atan2(handle_point[1] - standpoint[1], handle_point[0] - standpoint[0])]
            )
            if self._seen.obstacles.fits(pose[0], pose[1]) and self._go(pose, front.label):
                return

    # ---- shut ----

    def _shut(self, name: str) -> float:
        """Push a front shut, as often as it takes; return how far it is still open by the arm's joints, of a leaf by
        the eyes. Raises MotionFailed."""
        if name not in self._seen.fronts:
            raise MotionFailed("no_grasp", "the robot knows of no open door there", (name,))
        tally = Tally()
        for number in range(PUSHES):
            front = self._seen.fronts[name]
            if not front.slides and not number:  # the arm may have come against it since
                front = self._seen.moved(name, self._see_opening(front, front.value))
            value = self._push_toward(front, (-OVERSHOOT, 0.4 * front.value, 0.7 * front.value), tally)
            if value is None and not self._look_from_elsewhere(name, number):
                tally.raise_for(f"close({name})", (name,))
            if value is not None and is_closed(front.joint, self._seen.moved(name, value).value):
                break
        return self._seen.fronts[name].value

    def _look_from_elsewhere(self, name: str, number: int) -> bool:
        """Look at a leaf that cannot be pushed as it was seen from another base pose; whether there is one."""
        front = self._seen.fronts[name]
        for base in [] if front.slides else list(self._bases(front, shutting=True))[number + 1 :]:
            if self._go(base, front.label):
                self._seen.moved(name, self._see_opening(front, front.value))
                return True
        return False

    def _push_toward(self, front: Front, ends: tuple[float, ...], tally: Tally) -> float | None:
        """Push a front to the first of some values that the arm can push it to; return where it is then, None where it
        can to none of them."""
        for end in ends:
            for base in self._bases(front, shutting=end < front.value):
                if self._push(front, base, end, tally) is not None and self._go(base, front.label):
                    motion = self._push(front, self._robot.believed, end, tally)
                    if motion is not None:
                        return self._carry_out_push(front, motion)
        return None

    def _push(self, front: Front, base: np.ndarray, end: float, tally: Tally) -> Manipulation | None:
        """Return the motion that pushes a front from where it is to a value, from a base pose (3,), or None."""
        planner = self._planner()
        joint = front.joint
        part = joined(link_shapes(front.urdf())[joint.part])
        part.apply_translation(joint.origin)
        z0, z1 = front.panel[2:]
        heights = (max(min(0.45, (z0 + z1) / 2), z0), z1)
        contacts = push_points(joint, part, np.random.default_rng(5), 4, heights, opening=end > front.value)
        values = arc_values(front.value, end)
        turns = [np.linspace(*ends, len(values)) for ends in (*((tilt, tilt) for tilt in TILTS), *WIDE_TILTS)]
        arcs = pushes(front.name, joint, contacts, values, turns, self._robot.description.tip_overhang)
        return first_along(self._robot.beliefs, self._robot.arm, arcs, (base,), planner, tally)


def _position(at: np.ndarray) -> Position:
    return (float(at[0]), float(at[1]), float(at[2]))
