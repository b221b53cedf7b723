"""Handling: grasps of what was seen, letting go. Grasps, falls and collisions are pybullet's."""

from __future__ import annotations

from dataclasses import replace
from math import hypot

import numpy as np
from scenewright.stages.agent.senses import CANDIDATES, Base, Felt, Position, Take
from scenewright.stages.agent.world.physics.eyes import Surface
from scenewright.stages.agent.world.physics.grasps import LEVEL
from scenewright.stages.agent.world.physics.hands import Motion, Target, graspable, plan_grasp, reachable
from scenewright.stages.agent.world.physics.letting_go import DROP, JUST_OVER, SOME_WAY_OVER, Spot, plan_release
from scenewright.stages.agent.world.physics.looking import Looking
from scenewright.stages.agent.world.physics.robot_in_room import RobotInRoom, felt
from scenewright.stages.agent.world.physics.seen import FLOOR, FOUND_WITHIN, Seen
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.segments import Segment, whole_body

ONE_LEVEL = 0.1
"""What begins this near to a level stands on it [m]; by eye."""
CLOSED_ON_NOTHING = 0.004
"""Opening of the fingers below which they hold nothing [m]."""


class Handling:
    """The hand of a robot."""

    def __init__(self, robot: RobotInRoom, seen: Seen, looking: Looking) -> None:
        self._robot, self._seen, self._looking = robot, seen, looking

    def reaches(self, base: Base, at: Position, *, take: Take = "") -> bool:
        """Whether a free arm pose over a position exists in the robot's own map, from a base pose; to `take` what was
        seen there a grasp of it, from where it stands as seen from there."""
        self._robot.beliefs.hold(None)
        pose, front = np.array([base.x, base.y, base.yaw]), self._seen.front_at(at)
        forward = front is not None and not front.slides
        if front is not None and forward and not front.before(pose) or self._seen.taken(at):
            return False
        if take and base == self._robot.base:
            self._see_from_here(at)
        target = self._target(at, 0, base, level=take == "level") if take else None
        if target is not None:
            return graspable(self._robot.beliefs, pose, target, _chance(0))
        self._robot.beliefs.show(self._seen.boxes(at, base))
        return reachable(self._robot.beliefs, pose, at, np.random.default_rng(5), forward=forward)

    @property
    def held_level(self) -> bool:
        """Whether what it holds, if anything, was taken by a level hand."""
        hold = self._robot.hold
        return hold is None or float(-hold.rotation[2, 2]) < np.sin(LEVEL)

    def grasp(self, at: Position, label: str, candidate: int, *, level: bool = False, most: int = CANDIDATES) -> Felt:
        """Take the surface that was seen at a position. A slip and a wrong thing are not felt."""
        meant = self._nearest_thing(at)
        step = f"grasp {meant}" if meant and self._robot.room.things[meant].label == label else f"grasp a {label}"
        if self._robot.carried is not None or self._robot.hold is not None:
            self._robot.log.done("grasp", step, False, "api", "")
            return Felt(False, "no_grasp")
        try:
            self._take(at, candidate, level=level, most=most)
        except MotionFailed as failed:
            self._robot.draw_in()
            self._robot.log.done("grasp", step, False, "grasp", "")
            return felt(failed)
        name_in_hand = self._robot.driver.held or self._between_the_fingers()
        self._robot.carried = name_in_hand
        right = name_in_hand is not None and self._robot.room.things[name_in_hand].label == label
        cause = "grasp" if name_in_hand is None else "false_positive"
        self._robot.log.done(
            "grasp", step, right, cause, self._robot.room.things[name_in_hand].label if name_in_hand else ""
        )
        return Felt(True)

    def _see_from_here(self, at: Position) -> None:
        """Look once more at what will be grasped, from near by: what was measured from another stop is off by both
        stops' errors, and a look at all of a table shows little of each thing's back."""
        if self._looking.looked_near == (self._robot.base, at):
            return
        before = self._seen.surfaces
        self._looking.look(at, close=True)
        if self._seen.nearest(at) is None:
            self._seen.surfaces = before

    def _take(self, at: Position, candidate: int, *, level: bool, most: int) -> None:
        self._see_from_here(at)
        self._robot.beliefs.hold(None)
        target = self._target(at, candidate, level=level)
        if target is None:
            raise MotionFailed("no_grasp", "no surface was seen there")
        chance = _chance(candidate)
        motion = plan_grasp(self._robot.beliefs, self._robot.believed, self._robot.arm, target, chance, most)
        self._robot.grasps += 1
        self._robot.carry_out(motion.there)
        self._close_hand()
        self._seen.surfaces = [s for s in self._seen.surfaces if s is not target.surface]
        self._robot.hold = motion.hold
        lift, home = motion.away
        try:
            self._robot.carry_out((lift,))
        except MotionFailed:
            self._robot.driver.release()  # lifting is blocked: let go
            self._robot.hold = None
            raise
        try:
            self._robot.carry_out((home,))
        except MotionFailed:
            self._robot.draw_in()  # it holds it all the same
        if self._robot.driver.robot.configuration().opening < CLOSED_ON_NOTHING:
            self._robot.hold = None
            self._robot.driver.held = None

    def _target(self, at: Position, rank: int, base: Base | None = None, *, level: bool = False) -> Target | None:
        """Return what was seen nearest to a position, and show the arm what is around a base pose, the robot's own if
        none is given; None where nothing was seen."""
        surface = self._seen.nearest(at)
        if surface is None:
            return None
        self._seen.surfaces = [s for s in self._seen.surfaces if s is surface or not s.same_as(surface)]
        number = next(k for k, s in enumerate(self._seen.surfaces) if s is surface)
        self._robot.beliefs.show(self._seen.boxes(None, base))
        piece = self._seen.piece_at(at)
        measured = self._seen.pieces[piece].measured_top if piece is not None else None
        front = self._seen.front_at(surface.middle)
        if front is not None:  # a shelf, and several fronts, have several levels, of which one was measured
            one = front.alone and not front.leafless
            measured = front.floor if one or _near(front.floor, surface) else None
        floor = 0.0 if at[2] < FLOOR else float(surface.low[2]) if measured is None else measured
        if front is None:
            return Target(surface, f"thing_{number}", rank, floor, level=level)
        return Target(surface, f"thing_{number}", rank, floor, front.behind(surface.middle), front.inward)

    def _close_hand(self) -> None:
        tool = self._robot.driver.robot.tool_pose()[:3, 3]
        world = self._robot.room.world
        by_distance = [(float(np.linalg.norm(world.center_of_mass(n)[:3, 3] - tool)), n) for n in self._loose()]
        world.wake()
        for _, name in sorted(by_distance)[:2]:
            self._robot.room.moved[name] += 1
        try:
            self._robot.driver.grasp(min(by_distance)[1] if by_distance else "")
        except (MotionFailed, KeyError):
            self._robot.driver.held = None

    def _between_the_fingers(self) -> str | None:
        """What turned or slid in the hand is in it all the same."""
        return next((name for name in self._loose() if self._robot.driver.robot.grasps(name)), None)

    def _loose(self) -> list[str]:
        return [name for name in self._robot.room.things if name in self._robot.room.world.bodies]

    def release(self, at: Position, label: str, *, gently: bool = False) -> Felt:
        """Let go 15 cm over a position, or gently: down to contact."""
        name = self._robot.carried
        step = f"place {name or 'nothing'} on {label}"
        if name is None:
            self._robot.hold = None
            self._robot.log.done("release", step, False, "", "")
            return Felt(True)
        support = self._seen.support(at)
        around, beside = self._seen.boxes(), self._seen.boxes(at)
        nestled, front = self._seen.beside_on(at), self._seen.front_at(at)
        spot = Spot((at[0], at[1], support), self._seen.rim(at, support), around, beside, nestled)
        if front is not None and front.levels:
            spot = replace(spot, behind=front.behind(np.array(spot.at)), inward=front.inward)
        try:
            self._let_go(self._way_down(spot, (JUST_OVER, SOME_WAY_OVER) if gently else (DROP,)), gently)
        except MotionFailed as failed:
            self._robot.draw_in()
            self._robot.log.done("release", step, False, "place", "")
            return Felt(False, "no_trajectory", failed.failure)
        body = self._robot.room.body(name, None)
        on = self._robot.room.furniture[body.on].label if body.on in self._robot.room.furniture else ""
        on = self._robot.room.things[body.on].label if body.on in self._robot.room.things else on
        self._robot.log.done("release", step, on == label, "place", "")
        return Felt(True)

    def _way_down(self, here: Spot, heights: tuple[float, ...]) -> Motion:
        """Plan to let go at the first of the heights over a spot that can be got to. Raises MotionFailed."""
        for number, height in enumerate(heights):
            try:
                return plan_release(
                    self._robot.beliefs,
                    self._robot.believed,
                    self._robot.arm,
                    self._robot.hold,
                    here,
                    height,
                    self._robot.random,
                )
            except MotionFailed:
                if number + 1 == len(heights):
                    raise
        raise AssertionError("unreachable")

    def _let_go(self, motion: Motion, gently: bool) -> None:
        reach, down = motion.there
        self._robot.carry_out((reach,))
        path_parts = np.array_split(down.path, min(4, len(down.path))) if gently else [down.path]
        for rows in path_parts:
            self._robot.carry_out((Segment(rows, 0.0, down.pace),))
            if gently and self._touches():
                break
        released = self._robot.carried
        self._robot.driver.release()
        self._robot.carried, self._robot.hold = None, None
        if released is not None:
            self._robot.room.moved[released] += 1
        back = np.concatenate([self._robot.arm[None], motion.away[0].path[:, 3:]])
        first = replace(motion.away[0], path=whole_body(self._robot.believed, back))
        try:
            self._robot.carry_out((first, *motion.away[1:]))
        except MotionFailed:
            self._robot.draw_in()  # it let go already: what became of it is for the eyes
        self._robot.driver.wait(0.5)

    def _touches(self) -> bool:
        """Whether the wrist feels that what is held stands on something."""
        if self._robot.carried is None:
            return True
        body_id = self._robot.room.world.bodies[self._robot.carried].body_id
        contacts = self._robot.room.world.contacts(body_id)
        return sum(c.force for c in contacts if c.other_body != self._robot.driver.robot.body_id) > 1.0

    def _nearest_thing(self, at: Position) -> str:
        true = apply(inverse(self._robot.map_from_true()), np.array([at], float))[0]
        by_distance = [
            (hypot(x - true[0], y - true[1]), name)
            for name in self._loose()
            if not self._robot.room.things[name].carries
            for x, y, _ in [self._robot.room.lies(name)]
        ]
        return min(by_distance)[1] if by_distance and min(by_distance)[0] <= FOUND_WITHIN else ""


def _near(floor: float | None, surface: Surface) -> bool:
    return floor is not None and abs(floor - float(surface.low[2])) < ONE_LEVEL


def _chance(candidate: int) -> np.random.Generator:
    """Return what a grasp is planned with: what was found to be possible is found again when it is done."""
    return np.random.default_rng((5, candidate))
