"""Carry out a plan in a room: look, adapt the motion, execute, try again; then check the goal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.schemas.plan import BodyMatch, Failure
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.acting.erring_robot import ErringRobot
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.motion.arm_motion import ArmPlanner, Tally
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.kinematics import forward
from scenewright.stages.kit.motion.physical_robot import PhysicalRobot
from scenewright.stages.kit.motion.segments import Segment, whole_body
from scenewright.stages.kit.simulation.carriers import NOTHING, carrier
from scenewright.stages.kit.simulation.robot import base_pose
from scenewright.stages.plan.action import MotionRequest, action_named
from scenewright.stages.plan.correspondence import match_joint
from scenewright.stages.plan.eyes import Eyes, Room
from scenewright.stages.plan.level_carrying import LEVEL_PACE, levelled
from scenewright.stages.plan.pick_place import Budgets
from scenewright.stages.plan.refinement import DRIVE, Step, grasp_style, put_there_later, refine_action
from scenewright.stages.plan.world_model import RobotState, Snapshot, WorldModel, as_held

NOT_THERE = "not_found"
"""Failure of an action on what the room does not have: neither another attempt nor another plan helps."""
LOOKS = 3
"""Most places from which an action is looked at before it is carried out."""
JOINT_TOLERANCE = 0.05
"""A joint further than this from where a motion should have left it is taken to be where it is [rad or m]."""


@dataclass(frozen=True)
class Anchor:
    """A body that a planned motion is tied to, as it is believed."""

    body: str
    pose: np.ndarray
    """(4, 4), world."""
    text: str
    """URDF text: its shape."""


@dataclass
class Conduct:
    """What is carried out, and what came of it."""

    model: WorldModel
    room: Room
    physical: PhysicalRobot
    matches: dict[str, BodyMatch]
    joint_names: dict[str, str]
    """Joint of the plan -> joint in the room."""
    budgets: Budgets
    random: np.random.Generator
    relocalize: bool
    attempts: int
    failures: list[Failure] = field(default_factory=list)
    observe: Callable[[int], object] = lambda number: None
    """Called with the index of its last step when an action has been carried out."""
    eyes: Eyes | None = None
    """What looks tell; a plan that is replayed needs none."""
    seen_frames: dict[str, np.ndarray] = field(default_factory=dict)
    """Body -> how the frame of the shape that it was seen with lies in its frame in the room (4, 4)."""
    steps: list[Step] = field(default_factory=list)
    """The plan; what was planned anew stands in the place of what could not be carried out."""

    def run(
        self,
        state: RobotState,
        steps: list[Step],
        replans: int = 0,
        replan: Callable[[RobotState, int], list[Step] | None] = lambda state, number: None,
        reached: Callable[[], bool] = lambda: True,
    ) -> bool:
        """Execute the steps; return whether all were carried out. Failures are collected.

        When an action fails in all its attempts, or when the goal is not `reached` at the end, `replan` is asked for
        other steps, at most `replans` times: it gets the robot's state and the index of the first of them.
        """
        self.steps = list(steps)
        if not self.relocalize:
            return self._replay(steps)
        done = 0
        for turn in range(replans + 1):
            after, done = self._carry_out(state, done)
            if after is None:
                return False
            state = after
            complete = done == len(self.steps)
            missing = bool(self.failures) and self.failures[-1].kind == NOT_THERE
            if (complete and reached()) or turn == replans or missing:
                return complete
            self.look_around()
            further = replan(state, done)
            if further is None:
                return complete
            self.steps[done:] = further
        return False

    def _carry_out(self, state: RobotState, start: int) -> tuple[RobotState | None, int]:
        """Execute the steps from an index on until an action fails; return the robot's state (None: it stands where it
        cannot get back from) and the index of the first step that was not carried out."""
        origin = "start"
        number = start
        groups = _by_action(self.steps[start:])
        for index, group in enumerate(groups):
            following = [(later[-1].name, later[-1].arguments) for later in groups[index + 1 :]]
            after, carried_out = self._act(state, group, origin, number, following)
            if not carried_out or after is None:
                return after, number
            state = after
            name, arguments = group[-1].name, group[-1].arguments
            origin = action_named(name).target(arguments)
            number += len(group)
            self.observe(number - 1)
        return state, number

    # --- closed loop ------------------------------------------------------------------------------------------

    def _act(
        self,
        state: RobotState,
        group: list[Step],
        origin: str,
        number: int,
        following: list[tuple[str, tuple[str, ...]]],
    ) -> tuple[RobotState | None, bool]:
        """Carry out one action with its drives, trying again after a look; return the state after it (None: the arm
        does not get back) and whether it was carried out."""
        name, arguments = group[-1].name, group[-1].arguments
        action = action_named(name)
        for attempt in range(self.attempts):
            self.physical.action = number
            anchor = self._anchor(group[-1]) if attempt == 0 else None
            try:
                preferred = self._look_again(group[-1], anchor)
                style = grasp_style(self.model, arguments[0], following) if action.hand == "takes" else "any"
                further = put_there_later(name, arguments, following)
                request = MotionRequest(arguments, self.budgets, self.random, preferred, style, further=further)
                # eyes may have erred from afar, and what is held turns in the fingers on the way
                looks_again = state.holding is not None or (self.eyes is not None and self.eyes.again)
                before = self.model.snapshot() if looks_again else None
                steps, after = refine_action(self.model, state, name, request, origin)
            except MotionFailed as failed:
                self._note(failed, name, arguments)
                if failed.failure.kind == NOT_THERE:
                    break
                continue
            try:
                if before is not None and steps[0].name == DRIVE:
                    steps, after = self._look_from_there(before, state, steps, request, origin)
                for offset, step in enumerate(steps):
                    self.physical.action = number + min(offset, len(group) - 1)
                    self._execute(step)
                    self._check_joints(step, ended=step is steps[-1])
            except MotionFailed as failed:
                self._note(failed, name, arguments)
                lost = state.holding is not None and self.physical.held is None
                recovered = self._try_recovering(state, name, arguments)
                if recovered is None or lost:  # what was held is gone: nothing left to place
                    return recovered, False
                state = recovered
                continue
            state = self._perceive(after)
            try:
                state = action.after_motion(self, state, arguments)
                self._check_effect(name, arguments)
                return state, True
            except MotionFailed as failed:
                self._note(failed, name, arguments)
                if action.when_unmet == "stay":
                    return state, False
                if action.when_unmet == "back":  # the tray was lost, or something is in the way of levelling it
                    return self._try_recovering(state, name, arguments), False
        return state, False

    def _look_from_there(
        self, before: Snapshot, state: RobotState, steps: list[Step], request: MotionRequest, origin: str
    ) -> tuple[list[Step], RobotState]:
        """Carry out the drive that an action begins with, look once more from there and return the steps from there on,
        with the grasp or place of the planned ones where it still serves. Where nothing serves from there it drives and
        looks again, so that nothing is taken by what was seen from elsewhere. `before`: the model before they were
        planned. Raises MotionFailed."""
        for look in range(LOOKS):
            drive, step = steps[:2]
            self._execute(drive)
            arrived = replace(state, base=drive.segments[-1].path[-1, :3])
            self.model.restore(before)
            arrived = self._perceive(arrived)
            preferred = self._look_again(step, self._anchor(step))
            if preferred is not None:
                preferred = (arrived.base, preferred[1])
            before = self.model.snapshot()
            wish = replace(request, preferred=preferred)
            try:
                measured = self._without_uncertainty(wish, arrived.base)
                return refine_action(self.model, arrived, step.name, measured, origin)
            except MotionFailed:
                steps, after = refine_action(self.model, arrived, step.name, wish, origin)
            if steps[0].name != DRIVE or look == LOOKS - 1:
                break
            state = arrived
        return steps, after

    @staticmethod
    def _without_uncertainty(request: MotionRequest, base: np.ndarray) -> MotionRequest:
        """Return a request for a motion from where a look was taken, which has shown how wide things are."""
        return replace(request, base=base, budgets=replace(request.budgets, size_uncertainty=0.0))

    def _try_recovering(self, state: RobotState, name: str, arguments: tuple[str, ...]) -> RobotState | None:
        """Return the state after the way back, None (and a note) when the arm does not get there either."""
        try:
            return self._recover(state)
        except MotionFailed as failed:
            self._note(failed, name, arguments)
            return None

    def _note(self, failed: MotionFailed, name: str, arguments: tuple[str, ...]) -> None:
        action = f"{name}({', '.join(arguments)})"
        self.failures.append(failed.failure.model_copy(update={"action": action}))

    def matched(self, body: str) -> str:
        """Return the body of the room that a planned body is. Raises MotionFailed `not_found`."""
        match = self.matches[body]
        if match.matched is None:
            raise MotionFailed(NOT_THERE, f"the room has no body of the class of {body} near it", (body,))
        return match.matched

    def _look(self, name: str, arguments: tuple[str, ...]) -> None:
        """Take over pose, joints and shape of the bodies that an action names, as they are in the room now."""
        for body in action_named(name).bodies(self.model, arguments):
            self._see(body, self.matched(body))

    def _see(self, body: str, here: str) -> None:
        """Take over a body of the room as the eyes see it; what it stands on stays as believed."""
        assert self.eyes is not None
        sighting = self.eyes.seen(body, here)
        if sighting is None:
            return
        record, text, planes = sighting
        believed = self.model.records[body]
        beliefs_kept = {"parent": believed.parent, "movable": believed.movable, "furniture": believed.furniture}
        self.model.see(body, record.model_copy(update=beliefs_kept), text, planes)
        self.seen_frames[body] = inverse(self._map_from_true() @ self.physical.world.pose(here)) @ self.model.pose(body)

    def _map_from_true(self) -> np.ndarray:
        return self.physical.map_from_true() if isinstance(self.physical, ErringRobot) else np.eye(4)

    def pose_in_room(self, body: str) -> np.ndarray:
        """Return the pose (4, 4) of a body of the plan in the room, by the frame of the shape that it is seen with.
        Raises MotionFailed `not_found`."""
        return self.physical.world.pose(self.matched(body)) @ self.seen_frames.get(body, np.eye(4))

    def look_around(self) -> None:
        """Take over everything that moves or has joints and has a counterpart in the room; of what is held its pose.
        What stands on that is a body of its own afterwards."""
        self.model.set_down()
        for body, match in sorted(self.matches.items()):
            record = self.model.records.get(body)
            if match.matched is None or record is None:
                continue
            if match.matched == self.physical.held:
                self.model.world.set_pose(body, self.pose_in_room(body))
            elif record.carriable or record.joints:
                self._see(body, match.matched)

    def _anchor(self, step: Step) -> Anchor | None:
        """Return the body that a planned motion is tied to, before the look."""
        tied_to = action_named(step.name).tied_to
        if tied_to is None:
            return None
        body = step.arguments[tied_to]
        return Anchor(body, self.model.pose(body), self.model.text(body))

    def _look_again(self, step: Step, before: Anchor | None) -> tuple[np.ndarray, np.ndarray] | None:
        """Look, and return base pose and grasp (or place) of the planned step, moved along with the body they are tied
        to; None where there is no such body, and where eyes which err give it another shape than the motion was planned
        for: its frame is another, its rim or its handle elsewhere.
        """
        self._look(step.name, step.arguments)
        if before is None:
            return None
        model, action = self.model, action_named(step.name)
        reshaped = model.text(before.body) != before.text
        if reshaped and self.eyes is not None and self.eyes.again:
            return None
        assert step.manipulation is not None
        shift = model.pose(before.body)[:3, 3] - before.pose[:3, 3]
        base, goal = action.moved_along(model, step.arguments, step.manipulation, shift)
        # An arm that stands still does it from where it stands.
        return (base if model.description.drives else step.manipulation.base), goal

    def _execute(self, step: Step) -> None:
        item = None
        if action_named(step.name).hand == "takes":
            item = self.matched(step.arguments[0])
        for segment in step.segments:
            self.physical.follow(segment, item)
        self.physical.recording.keyframe(self.physical.action, step.name)

    def _check_joints(self, step: Step, *, ended: bool) -> None:
        """Take over where joints are that a motion did not leave where it should have. Raises MotionFailed
        `condition_not_met` for such a joint while the action has not `ended`: what follows was planned around it, but
        the next action is planned anew."""
        for planned, goal in step.manipulation.joint_values.items() if step.manipulation is not None else ():
            room_joint, body = self.joint_names[planned], self.matched(self.model.owner(planned))
            value = self.physical.world.joint_value(body, room_joint)
            if abs(value - goal) <= JOINT_TOLERANCE:
                continue
            if not ended:
                raise MotionFailed(
                    "condition_not_met",
                    f"the joint {room_joint} stands at {value:.3f} instead of {goal:.3f}",
                    (planned,),
                    {"value": value, "goal": goal},
                )
            self.model.move_joint(planned, value)

    def _check_effect(self, name: str, arguments: tuple[str, ...]) -> None:
        """Raises MotionFailed `condition_not_met` when the room is not as the action should leave it."""
        action_named(name).check_effect(self, arguments)

    def joint_in_room(self, planned: str) -> tuple[Joint, float]:
        """Return the joint of the room that a planned joint is, and its value now. Raises MotionFailed `not_found`."""
        body, room_joint = self.matched(self.model.owner(planned)), self.joint_names[planned]
        joint = next(joint for joint in self.room.records[body].joints if joint.name == room_joint)
        return joint, self.physical.world.joint_value(body, room_joint)

    def _perceive(self, state: RobotState) -> RobotState:
        """Correct what the robot believes of itself and of what it holds by what the joints and a look say."""
        base, arm = state.base, state.arm
        if self.physical.held is None:
            self.model.set_down()
            return RobotState(base, arm)
        tool_from_item = self.physical.held_pose()
        if state.holding is not None:
            tool_from_item = tool_from_item @ self.seen_frames.get(state.holding, np.eye(4))
            self._take_along(state.holding)
        return RobotState(base, arm, state.holding, tool_from_item, inverse(tool_from_item))

    def level(self, state: RobotState) -> RobotState:
        """Turn the hand so that a laden tray, which gave way in the fingers, stands level; return the state then.

        Raises MotionFailed as `PhysicalRobot.follow` does.
        """
        if state.tool_from_item is None:
            return state
        model = self.model
        world_from_tool = base_pose(state.base, model.description) @ forward(model.chain, state.arm)
        planner = ArmPlanner(model, self.random, self.budgets.path_samples).under(as_held(model, state))
        goal = levelled(world_from_tool, state.tool_from_item)
        path = planner.line(state.base, state.arm, goal, Tally())
        if path is None:
            return state
        self.physical.follow(Segment(whole_body(state.base, path), 0.0, LEVEL_PACE, "", state.holding), None)
        return self._perceive(replace(state, arm=path[-1]))

    def _take_along(self, item: str) -> None:
        """Join what is held with what stands on it, as they are in the room now: the load counts in collision checks.
        What has fallen off stands on something else from now on."""
        self.model.set_down()
        load = self.model.load(item)
        planned = {match.matched: body for body, match in self.matches.items() if match.matched is not None}
        for body in (item, *load):
            room_body = self.matches[body].matched
            if room_body is None:
                continue
            self.model.world.set_pose(body, self.pose_in_room(body))
            below = carrier(self.physical.world, room_body)
            if body != item and below is not None and planned.get(below) not in (item, *load):
                self.model.put_on(body, planned.get(below, NOTHING))
        self.model.take_aboard(item)

    def _recover(self, state: RobotState) -> RobotState:
        """Go back the way the arm came since the base last stood still, then believe what the joints say."""
        rows = self.physical.way_back()
        if self.physical.held is None:
            self.physical.release()
        self.physical.recording.keyframe(self.physical.action, "failed")
        self.physical.follow(Segment(rows, self.model.description.opening, 0.5), None)
        base, arm = rows[-1, :3], rows[-1, 3:]
        return self._perceive(RobotState(base, arm, state.holding, state.tool_from_item, state.body_from_tool))

    # --- open loop --------------------------------------------------------------------------------------------

    def _replay(self, steps: list[Step]) -> bool:
        """Replay the planned motions as they are."""
        for number, step in enumerate(steps):
            self.physical.action = number
            try:
                self._execute(step)
            except MotionFailed as failed:
                self._note(failed, step.name, step.arguments)
                return False
            later = any(
                (step.name, step.arguments) == (later_step.name, later_step.arguments)
                for later_step in steps[number + 1 :]
            )
            if step.manipulation is not None and not later:
                try:
                    self._check_effect(step.name, step.arguments)
                except MotionFailed as failed:
                    self._note(failed, step.name, step.arguments)
                    return False
                self.observe(number)
        return True


def _by_action(steps: list[Step]) -> list[list[Step]]:
    """Group steps so that each group ends with the last manipulation of one action."""
    groups: list[list[Step]] = []
    for step in steps:
        same = groups and groups[-1][-1].name == step.name and groups[-1][-1].arguments == step.arguments
        if groups and (groups[-1][-1].name == DRIVE or same):
            groups[-1].append(step)
        else:
            groups.append([step])
    merged: list[list[Step]] = []
    for group in groups:
        last = group[-1]
        if merged and merged[-1][-1].name == last.name and merged[-1][-1].arguments == last.arguments:
            merged[-1] += group
        else:
            merged.append(group)
    return merged


def joint_pairs(
    planned: dict[str, SceneBody], room: dict[str, SceneBody], matches: dict[str, BodyMatch]
) -> dict[str, str]:
    """Return which joint of the room each planned joint is; joints without a counterpart are left out."""
    pairs: dict[str, str] = {}
    for name, record in planned.items():
        room_body = matches[name].matched
        if room_body is None:
            continue
        for joint in record.joints:
            counterpart = match_joint(record, joint.name, room[room_body])
            if counterpart is not None and counterpart not in pairs.values():
                pairs[joint.name] = counterpart
    return pairs
