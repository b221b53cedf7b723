"""Clearing a table in physics: the actions of stages/tableware/actions, carried out by an arm that touches things.

Nothing is fastened to anything: what is carried is held by friction between the pads, and may slip, tip or fall.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, hypot, pi, sin
from typing import Any

import numpy as np
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.simulation.robot_description import RobotDescription, load_robot
from scenewright.stages.kit.simulation.world import PhysicsWorld
from scenewright.stages.tableware.actions.grasp import Grasp
from scenewright.stages.tableware.actions.pull import Pull
from scenewright.stages.tableware.actions.stack import Stack
from scenewright.stages.tableware.planning.action import Action, Primitive
from scenewright.stages.tableware.simulation.arm import ARM, BACK_FRICTION, PAD_FRICTION, Arm
from scenewright.stages.tableware.simulation.holds import (
    FREE,
    Hold,
    bar_hold,
    cargo,
    jaw_clearance,
    pair_hold,
    rim_hold,
    tool_pose,
    walls,
)
from scenewright.stages.tableware.simulation.push_place import PULL_SPEED, push_place
from scenewright.stages.tableware.simulation.tabletop import BIN_CENTER, Tabletop
from scenewright.stages.tableware.simulation.trial import Trial
from scenewright.stages.tableware.world.items import Item, Table, rise
from scenewright.stages.tableware.world.overhead import OverheadCamera, Scheme, overhead_camera, render_overhead

TRAVEL = 0.17
"""Height of the fingertips on the way above everything [m]."""
HOVER = 0.015
"""Height [m] over the table at which a utensil is carried to another."""
EMPTY = 0.0008
"""Fingers that are nearer to each other than this [m] hold nothing: the thinnest wall has 3 mm."""
HEAVY = 4
"""Walls of two piles from which on the hand presses harder; with 40 N the outer ones slip."""
LIFT = 0.06
"""Height by which what is held goes above everything else [m]; by eye."""


@dataclass(frozen=True)
class Speeds:
    """Of the tool [m/s], shares of the arm's joint speeds, forces [N]."""

    descend: float = 0.25
    touch: float = 0.10
    lift: float = 0.15
    pull: float = PULL_SPEED
    carry: float = 0.7
    force: float = 40.0
    """For bowls and plates."""
    heavy: float = 120.0
    """For two piles of bowls, `HEAVY` walls together: with 40 N the outer ones slip."""
    least: float = 20.0
    """The least that a 2F-85 presses with: for cups, however many (pressed harder, one of some nested ones is wedged
    out of the others), and for utensils, taken or led."""
    carry_loose: float = 0.4
    """With things that stand or lie free in what is held."""
    lift_loose: float = 0.09


class PhysicsTable:
    """A world as `fast.FastWorld`: `table`, `trial`, `do`. `robot`: by default the one of the thesis."""

    def __init__(
        self,
        table: Table,
        *,
        robot: RobotDescription | None = None,
        speeds: Speeds | None = None,
        record: Callable[[PhysicsTable, str], None] | None = None,
    ) -> None:
        self.speeds = speeds or Speeds()
        self.world = PhysicsWorld()
        self.top = Tabletop(self.world, table)
        self.arm = Arm(self.world, robot or load_robot(ARM))
        self.record = record
        self.top.rest(1.0)
        self.table = self.top.read()
        self.trial = Trial(left=len(self.table.items))
        self.troubles: list[str] = []
        """What could not be done in the last action, in order."""
        self.vain: tuple[str, ...] = ()
        """What the hand closed on in vain in the last action: nothing was between the fingers."""
        self.fallen: list[str] = []
        """Everything that fell off the table or over, in order."""
        self._motions: dict[type[Primitive], Callable[[Any, Table], None]] = {
            Grasp: self._grasp,
            Pull: self._pull,
            Stack: self._stack,
        }
        self._key("start")

    def close(self) -> None:
        """Free the physics engine; the world cannot be used afterwards."""
        self.world.close()

    def image(
        self, seed: int = 0, level: str = "usual", scheme: Scheme = "dark_on_white"
    ) -> tuple[np.ndarray, np.ndarray, OverheadCamera]:
        """Return what the overhead camera sees of the bodies: color (H, W, 3) uint8, depth (H, W) float32 [m], camera.
        The arm is out of the picture."""
        items = sorted(self.top.read(everything=True).items, key=lambda item: item.name)
        poses = {item.name: self.top.pose(item.name) for item in items}
        view = overhead_camera()
        color, depth = render_overhead(Table(tuple(items)), seed, level, scheme, view=view, poses=poses)
        return color, depth, view

    def _key(self, label: str) -> None:
        if self.record is not None:
            self.record(self, label)

    # --- actions ----------------------------------------------------------------------------------------------

    def do(self, action: Action, seen: Table | None = None) -> None:
        """Carry out an action that was decided on `seen`, by default the true table; a composite one without looking in
        between. What then is where is read from the bodies."""
        seen = seen or self.table
        self.troubles, self.vain = [], ()
        try:
            for number, part in enumerate(action.parts):
                seen = action.parts[number - 1].after(seen) if number else seen
                self._motions[type(part)](part, seen)
        except MotionFailed as failure:
            self.troubles.append(str(failure))
            self._retreat()
        self._read_table()
        self._key("done")

    def _read_table(self) -> None:
        self.arm.seconds += self.top.rest(0.6)
        self.table = self.top.read()
        lying = len(self.top.bodies) - len(self.table.items)
        self.trial.moved = len(self.top.binned)
        self.trial.dropped = len(self.top.lost) + lying
        gone = [*self.top.lost, *(name for name in self.top.bodies if name not in self.table.by_name)]
        self.fallen = [name for name in self.fallen if name in gone]
        self.fallen += [name for name in gone if name not in self.fallen]
        self.trial.left = len(self.table.items)
        self.trial.seconds = self.arm.seconds

    def _grasp(self, action: Grasp, seen: Table) -> None:
        names = [name for name in action.items if name in seen.by_name]
        if len(names) == 2:
            hold = pair_hold(seen, names[0], names[1], action.p_G, action.theta_G)
            if hold.clearance < 0.0:
                raise MotionFailed("in_collision", f"open jaws do not fit around {' and '.join(names)}")
        elif seen.by_name[names[0]].is_dish:
            hold = rim_hold(seen, names[0], action.theta_G)
        else:
            hold = bar_hold(seen, names[0])
        self._take(hold, finger_force(seen, names, self.speeds), names)
        self._to_bin(seen, names)

    def _take(self, hold: Hold, force: float, names: list[str]) -> None:
        """Go there and close. Raises MotionFailed when nothing is there."""
        self._above(hold.pose, hold.opening)
        self._descend(hold.pose)
        self.arm.close(force)
        self._key("closed")
        if self.arm.finger_gap() < EMPTY:
            self.vain = tuple(names)
            raise MotionFailed("not_held", f"the fingers closed on nothing where {' and '.join(names)} should be")

    def _above(self, pose: np.ndarray, opening: float) -> None:
        """Bring the empty hand over a pose, with the fingers at an opening."""
        high = _at_height(pose, TRAVEL + (0.05 if pose[2, 3] > 0.08 else 0.0))
        arm = self.arm.solve(high)
        if arm is None:
            raise MotionFailed("no_inverse_kinematics", "the arm does not reach above the grasp")
        self._settle()
        self.arm.jump(arm)
        self.arm._set_fingers(opening)
        self.arm.seconds += 0.3

    def _settle(self) -> None:
        """Let moving things come to rest while the hand is away from them; the way takes longer than that."""
        self.top.rest(0.5)

    def _descend(self, pose: np.ndarray) -> None:
        above_grasp = pose.copy()
        above_grasp[:3, 3] -= 0.025 * pose[:3, 2]
        self.arm.move_line(above_grasp, self.speeds.descend)
        self.arm.move_line(pose, self.speeds.touch)

    def _retreat(self) -> None:
        """Let go and go straight up."""
        self.arm.open_to(min(self.arm.description.opening, self.arm.finger_gap() + 0.016))
        pose = self.arm.pose_of(self.arm.target)
        try:
            self.arm.move_line(_at_height(pose, TRAVEL), self.speeds.descend)
        except MotionFailed:
            self.arm.put(self.arm.description.carry)

    def _to_bin(self, seen: Table, names: list[str]) -> None:
        """Lift what is held, carry it over the bin, let go."""
        held_names = {name for name in names} | {item.name for name in names for item in seen.load(name)}
        self.top.wake_near([np.array(seen.by_name[name].position[:2]) for name in held_names], 0.03)
        pose = self.arm.pose_of(self.arm.target)
        lowest = min(seen.by_name[name].position[2] for name in held_names)
        highest = max([item.lip for item in seen.items if item.name not in held_names], default=0.0)
        clear = highest + LIFT - lowest
        up = _at_height(pose, pose[2, 3] + max(clear, 0.06))
        self.arm.move_line(_at_height(pose, pose[2, 3] + 0.01), 0.05)
        two = len(names) == 2
        loose = any(cargo(seen, name) for name in names if seen.by_name[name].is_dish)
        self.arm.move_line(up, self.speeds.lift_loose if loose else self.speeds.lift)
        self.top.sleep()
        self._key("lifted")
        if self.arm.finger_gap() < EMPTY:
            raise MotionFailed("not_held", f"{' and '.join(names)} slipped out of the fingers")
        self.trial.trips += 1
        offset = np.zeros(2) if two else np.array(seen.by_name[names[0]].position[:2]) - pose[:2, 3]
        goal = self._bin_pose(up, offset)
        self.arm.move_joints(goal, self.speeds.carry_loose if loose else self.speeds.carry)
        self._key("over the bin")
        self.arm.open_to(min(self.arm.description.opening, self.arm.finger_gap() + 0.03))
        self.arm.wait(0.15)
        self.top.sweep()
        for _ in range(12):
            if not self._near_bin():
                break
            self.arm.wait(0.05)
            self.top.sweep()
        self._key("released")

    def _near_bin(self) -> bool:
        return any(hypot(*(self.top.pose(name)[:2, 3] - np.array(BIN_CENTER))) < 0.25 for name in self.top.bodies)

    def _bin_pose(self, pose: np.ndarray, offset: np.ndarray) -> np.ndarray:
        """Return arm values over the bin with the hand leaning as it does, whose turn moves the wrist least."""
        best: tuple[float, np.ndarray] | None = None
        for turn in np.linspace(-pi, pi, 16, endpoint=False):
            rotation = np.array([[cos(turn), -sin(turn), 0.0], [sin(turn), cos(turn), 0.0], [0.0, 0.0, 1.0]])
            bin_pose = pose.copy()
            bin_pose[:3, :3] = rotation @ pose[:3, :3]
            bin_pose[:2, 3] = np.array(BIN_CENTER) - rotation[:2, :2] @ offset
            arm = self.arm.solve(bin_pose, held=True)
            if arm is not None:
                cost = float(np.abs(arm - self.arm.target).max())
                if best is None or cost < best[0]:
                    best = (cost, arm)
        if best is None:
            raise MotionFailed("no_inverse_kinematics", "the arm does not reach the bin")
        return best[1]

    # --- pulls ------------------------------------------------------------------------------------------------

    def _pull(self, action: Pull, seen: Table) -> None:
        self.trial.pulls += 1
        item = seen.by_name[action.item]
        if item.is_dish:
            self._pull_dish(action, seen)
        else:
            self._pull_bar(action, seen)

    def _pull_dish(self, action: Pull, seen: Table) -> None:
        start, end = np.array(action.p_S[:2]), np.array(action.p_E[:2])
        length = float(np.linalg.norm(end - start))
        if length < 0.002:
            return
        direction = (end - start) / length
        push = push_place(seen, action.item, direction)
        if push is None:
            raise MotionFailed("in_collision", f"there is no room for the fingers in {action.item}")
        begin = np.append(start + push.start * direction, push.tip)
        finish = np.append(end + push.reach * direction, push.tip)
        pose = tool_pose(begin, push.closing)
        self._above(pose, 0.002 if push.spread else push.opening)
        self._descend(pose)
        self.top.wake_near([start], 0.05)
        final_pose = tool_pose(finish, push.closing)
        self.arm.touch_with(BACK_FRICTION)
        try:
            if push.spread:
                self.arm.open_to(push.opening)
            self._key("inside")
            self.arm.move_line(final_pose, self.speeds.pull)
            self._key("pulled")
            away = final_pose.copy()
            away[:2, 3] -= 0.006 * direction
            self.arm.move_line(away, 0.1)
        finally:
            self.arm.touch_with(PAD_FRICTION)
        self.arm.move_line(_at_height(away, TRAVEL + 0.03), self.speeds.descend)

    def _pull_bar(self, action: Pull, seen: Table) -> None:
        """Take a utensil where it lies, carry it just above the table, let go. A hand that presses with 20 N does not
        let it give way: dragged, it would sweep the one beside which it is to lie off the table. It is taken where the
        jaws fit, at its middle if they do there."""
        item = seen.by_name[action.item]
        turn = (action.theta_E - action.theta_S + pi / 2) % pi - pi / 2
        hold = bar_hold(seen, action.item)
        tip = np.array([0.0, 0.0, hold.pose[2, 3]])
        offset = hold.pose[:2, 3] - np.array(item.position[:2])
        rotation = np.array([[cos(turn), -sin(turn)], [sin(turn), cos(turn)]])
        self._take(hold, self.speeds.least, [action.item])
        goal = np.array([*action.p_E[:2], 0.0]) + np.array([*(rotation @ offset), 0.0]) + tip
        final_pose = tool_pose(goal, action.theta_S + turn)
        pose = self.arm.pose_of(self.arm.target)
        self.arm.move_line(_at_height(pose, pose[2, 3] + HOVER), self.speeds.pull)
        self.arm.move_line(_at_height(final_pose, final_pose[2, 3] + HOVER), self.speeds.pull)
        self.arm.move_line(final_pose, self.speeds.pull)
        self._key("pulled")
        self.arm.open_to(0.022)
        self.arm.move_line(_at_height(final_pose, TRAVEL), self.speeds.descend)

    # --- stacks -----------------------------------------------------------------------------------------------

    def _stack(self, action: Stack, seen: Table) -> None:
        self.trial.stacks += 1
        name = action.u_G.items[0]
        item, onto = seen.by_name[name], seen.by_name[action.onto]
        if item.is_dish:
            nested = rise(item.measures, onto.measures) if onto.is_dish else 0.0
            room = 0.014 if onto.measures.height + 0.002 > item.measures.height else 0.02
            hold = rim_hold(seen, name, action.u_G.theta_G, min(room, max(nested, 0.012)))
        else:
            hold = bar_hold(seen, name)
        self._take(hold, finger_force(seen, [name], self.speeds), [name])
        pose = self.arm.pose_of(self.arm.target)
        held_names = {name, *(load.name for load in seen.load(name))}
        self.top.wake_near([np.array(item.position[:2])], 0.03)
        highest = max([neighbour.lip for neighbour in seen.items if neighbour.name not in held_names], default=0.0)
        up = _at_height(pose, pose[2, 3] + max(highest + 0.04 - item.position[2], 0.04))
        loose = item.is_dish and bool(cargo(seen, name))
        self.arm.move_line(_at_height(pose, pose[2, 3] + 0.01), 0.05)
        self.arm.move_line(up, self.speeds.lift_loose if loose else self.speeds.lift)
        self.top.sleep()
        self._key("lifted")
        drop = 0.002 if item.is_dish else 0.003
        over = self._placing(action, seen, item, onto, pose, up[2, 3])
        values = self.arm.solve(over, held=True)
        if values is None:
            raise MotionFailed("no_inverse_kinematics", "the arm does not reach the place")
        self.arm.move_joints(values, self.speeds.carry_loose if loose else self.speeds.carry)
        self.top.wake_near([np.array(onto.position[:2])], 0.03)
        down = over.copy()
        down[2, 3] = pose[2, 3] + action.p_L[2] - item.position[2] + drop
        above_base = _at_height(down, down[2, 3] + 0.02)
        self.arm.move_through([above_base], self.speeds.lift)
        self.arm.move_line(down, 0.06)
        self._key("placed")
        self.arm.open_to(min(self.arm.description.opening, self.arm.finger_gap() + 2 * 0.006))
        self.arm.move_line(_at_height(down, down[2, 3] + 0.05), self.speeds.descend)
        self._key("let go")

    def _pile(self, seen: Table, item: Item) -> tuple[Item, ...]:
        return next(pile for pile in seen.stacks if any(member.name == item.name for member in pile))

    def _placing(
        self, action: Stack, seen: Table, item: Item, onto: Item, pose: np.ndarray, height: float
    ) -> np.ndarray:
        """Return the tool pose above the place: a dish is turned so that the open jaws fit there, a utensil so that it
        lies along the one below it."""
        base_middle = np.array(action.p_L[:2])
        offset = pose[:2, 3] - np.array(item.position[:2])
        turns = [0.0]
        if not item.is_dish and not onto.is_dish:
            turns = [(onto.yaw - item.yaw + pi / 2) % pi - pi / 2]
        elif item.is_dish:
            turns = sorted(np.linspace(-pi, pi, 24, endpoint=False), key=abs)
        own_names = {neighbour.name for neighbour in self._pile(seen, onto)} | {
            item.name,
            *(o.name for o in seen.load(item.name)),
        }
        others = [neighbour for neighbour in seen.items if neighbour.name not in own_names]
        best: tuple[float, np.ndarray] | None = None
        for turn in turns:
            rotation = np.array([[cos(turn), -sin(turn), 0.0], [sin(turn), cos(turn), 0.0], [0.0, 0.0, 1.0]])
            placing_pose = pose.copy()
            placing_pose[:3, :3] = rotation @ pose[:3, :3]
            placing_pose[:2, 3] = base_middle + rotation[:2, :2] @ offset
            placing_pose[2, 3] = pose[2, 3] + action.p_L[2] - item.position[2]
            clearance = jaw_clearance(placing_pose, 0.03, others, [])
            placing_pose = _at_height(placing_pose, height)
            if self.arm.solve(placing_pose, held=True) is None:
                continue
            if best is None or clearance > best[0]:
                best = (min(clearance, FREE), placing_pose)
            if clearance >= FREE:
                break
        if best is None:
            raise MotionFailed("no_inverse_kinematics", "the arm does not reach the place")
        return best[1]


def finger_force(seen: Table, names: list[str], speeds: Speeds) -> float:
    """Return the force [N] of each finger for some piles."""
    if all(not seen.by_name[name].is_dish for name in names):
        return speeds.least
    gripped = [item for name in names for item in walls(seen, name)]
    if all(item.kind == "cup" for item in gripped):
        return speeds.least
    return speeds.heavy if len(names) == 2 and len(gripped) >= HEAVY else speeds.force


def _at_height(pose: np.ndarray, height: float) -> np.ndarray:
    high = pose.copy()
    high[2, 3] = max(height, pose[2, 3])
    return high
