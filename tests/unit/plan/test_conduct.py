"""Carrying a plan out: trying again, planning anew, looking at what was put down; without any search for motions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scenewright.schemas.plan import BodyMatch
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.segments import Manipulation, Segment
from scenewright.stages.kit.simulation.world import PhysicsWorld, load_scene, read_scene_bodies
from scenewright.stages.plan import conduct as conduct_module
from scenewright.stages.plan.action import MotionRequest
from scenewright.stages.plan.actions.place import MOST_TILT, Place
from scenewright.stages.plan.conduct import Conduct
from scenewright.stages.plan.eyes import Room, TrueEyes
from scenewright.stages.plan.pick_place import Budgets
from scenewright.stages.plan.refinement import Step
from scenewright.stages.plan.world_model import RobotState, WorldModel

BUDGETS = Budgets(bases=1, pairs=1, path_samples=1, paths=1)
START = RobotState(np.zeros(3), np.zeros(7))
MOTION = Manipulation(np.zeros(3), ())


def drive(origin: str, target: str) -> Step:
    return Step("drive", (origin, target), (), None)


def act(name: str, *arguments: str) -> Step:
    return Step(name, arguments, (), MOTION)


PLAN = [drive("start", "cup"), act("pick", "cup", "table"), drive("cup", "shelf"), act("place", "cup", "shelf")]


class Scripted(Conduct):
    """Actions succeed, unless their text is in `failing` so often; the arm does not get back from `stuck`."""

    failing: dict[str, int]
    stuck: str = ""
    done: list[tuple[str, int, str]]
    looks: int = 0

    def _act(self, state, group, origin, number, following):  # type: ignore[no-untyped-def]
        text = group[-1].text
        self.done.append((text, number, origin))
        if text == self.stuck:
            return None, False
        after = RobotState(state.base + 1.0, state.arm)
        if self.failing.get(text, 0) > 0:
            self.failing[text] -= 1
            return after, False
        return after, True

    def look_around(self) -> None:
        self.looks += 1


def scripted(failing: dict[str, int] | None = None, stuck: str = "", relocalize: bool = True) -> Scripted:
    room = Room({}, {}, {})
    model, physical = SimpleNamespace(), SimpleNamespace(action=-1, held=None)
    found = Scripted(model, room, physical, {}, {}, BUDGETS, np.random.default_rng(0), relocalize, 2)  # type: ignore[arg-type]
    found.failing, found.stuck, found.done = dict(failing or {}), stuck, []
    return found


class Replan:
    """Gives lists of steps one after another; None when there are none left."""

    def __init__(self, *plans: list[Step]) -> None:
        self.plans = list(plans)
        self.asked: list[tuple[float, int]] = []

    def __call__(self, state: RobotState, number: int) -> list[Step] | None:
        self.asked.append((float(state.base[0]), number))
        return self.plans.pop(0) if self.plans else None


class Reached:
    """The goal holds from some asking on."""

    def __init__(self, *answers: bool) -> None:
        self.answers = list(answers)

    def __call__(self) -> bool:
        return self.answers.pop(0)


def test_a_plan_that_goes_well_is_not_made_anew() -> None:
    conduct, replan, observed = scripted(), Replan(), []
    conduct.observe = observed.append
    assert conduct.run(START, PLAN, 3, replan, Reached(True))
    assert conduct.done == [("pick(cup, table)", 0, "start"), ("place(cup, shelf)", 2, "cup")]
    assert observed == [1, 3]  # the last step of each action
    assert conduct.steps == PLAN and replan.asked == [] and conduct.looks == 0


def test_after_a_failed_action_the_new_steps_stand_in_its_place() -> None:
    other = [drive("shelf", "desk"), drive("desk", "desk"), act("place", "cup", "desk")]
    conduct, replan, observed = scripted({"place(cup, shelf)": 1}), Replan(other), []
    conduct.observe = observed.append
    assert conduct.run(START, PLAN, 1, replan, Reached(True))
    assert replan.asked == [(2.0, 2)]  # the state after both tries, the index of the drive before the place
    assert conduct.steps == [*PLAN[:2], *other] and conduct.looks == 1
    assert conduct.done[2:] == [("place(cup, desk)", 2, "start")]
    assert observed == [1, 4]


def test_when_the_goal_does_not_hold_at_the_end_steps_are_added() -> None:
    again = [act("pick", "cup", "floor"), act("place", "cup", "shelf")]
    conduct, replan = scripted(), Replan(again)
    reached = Reached(False, True)
    assert conduct.run(START, PLAN, 2, replan, reached)
    assert replan.asked == [(2.0, 4)] and reached.answers == []
    assert conduct.steps == [*PLAN, *again] and conduct.looks == 1
    assert [number for _, number, _ in conduct.done] == [0, 2, 4, 5]


@pytest.mark.parametrize("replans", [0, 1, 3])
def test_no_more_plans_than_allowed_after_failures(replans: int) -> None:
    conduct, replan = scripted({"pick(cup, table)": 99}), Replan(*[PLAN] * 9)
    assert not conduct.run(START, PLAN, replans, replan, Reached())  # an unfinished plan's goal is not looked at
    assert [number for _, number in replan.asked] == [0] * replans
    assert [text for text, _, _ in conduct.done] == ["pick(cup, table)"] * (replans + 1)
    assert conduct.looks == replans


@pytest.mark.parametrize("replans", [0, 1, 3])
def test_no_more_plans_than_allowed_when_the_goal_does_not_hold(replans: int) -> None:
    conduct, replan = scripted(), Replan(*[PLAN] * 9)
    assert conduct.run(START, PLAN, replans, replan, lambda: False)  # all was carried out, the goal is another matter
    assert [number for _, number in replan.asked] == [4 * turn for turn in range(1, replans + 1)]
    assert conduct.steps == PLAN * (replans + 1)


def test_a_failure_then_a_goal_that_does_not_hold_take_turns() -> None:
    second, third = [act("place", "cup", "desk")], [act("close", "hinge")]
    conduct, replan = scripted({"place(cup, shelf)": 1, "place(cup, desk)": 1}), Replan(second, second, third)
    assert conduct.run(START, PLAN, 3, replan, Reached(False, True))
    assert [number for _, number in replan.asked] == [2, 2, 3]
    assert conduct.steps == [*PLAN[:2], *second, *third]


def test_an_arm_that_does_not_get_back_ends_it() -> None:
    conduct, replan = scripted(stuck="pick(cup, table)"), Replan(PLAN)
    assert not conduct.run(START, PLAN, 3, replan)
    assert replan.asked == [] and conduct.looks == 0 and len(conduct.done) == 1


@pytest.mark.parametrize(("failing", "carried_out"), [({"place(cup, shelf)": 1}, False), ({}, True)])
def test_without_another_plan_it_ends_as_it_is(failing: dict[str, int], carried_out: bool) -> None:
    conduct, replan = scripted(failing), Replan()
    assert conduct.run(START, PLAN, 3, replan, lambda: False) == carried_out
    assert len(replan.asked) == 1 and conduct.steps == PLAN


def test_a_plan_of_nothing_is_a_plan() -> None:
    """Everything is as it should be but for a step that failed: the search has nothing to add."""
    conduct, replan = scripted({"place(cup, shelf)": 1}), Replan([])
    assert conduct.run(START, PLAN, 1, replan, Reached(True))
    assert conduct.steps == PLAN[:2]


# --- tries of one action --------------------------------------------------------------------------------------


class Tries(Conduct):
    """What one action does is scripted: where its motion fails, and whether its effect shows."""

    refuse: int = 0
    """So many times there is no motion."""
    block: int = 0
    """So many times the motion is blocked on the way."""
    ineffective: int = 0
    lose: bool = False
    reason: str = "no_path"

    def _look(self, name, arguments):  # type: ignore[no-untyped-def]
        if self.refuse > 0:
            self.refuse -= 1
            raise MotionFailed(self.reason, "it refuses")

    def _anchor(self, step):  # type: ignore[no-untyped-def]
        return None

    def _execute(self, step):  # type: ignore[no-untyped-def]
        if self.block > 0:
            self.block -= 1
            if self.lose:
                self.physical.held = None
            raise MotionFailed("path_blocked", "something is in the way")

    def _recover(self, state):  # type: ignore[no-untyped-def]
        return self._perceive(RobotState(state.base - 1.0, state.arm, state.holding))

    def _perceive(self, state):  # type: ignore[no-untyped-def]
        return state if self.physical.held else RobotState(state.base, state.arm)

    def _check_effect(self, name, arguments):  # type: ignore[no-untyped-def]
        if self.ineffective > 0:
            self.ineffective -= 1
            raise MotionFailed("condition_not_met", "not as it should be")


@pytest.fixture
def tries(monkeypatch: pytest.MonkeyPatch) -> Tries:
    def refine(model, state, name, request, origin):  # type: ignore[no-untyped-def]
        return [act(name, *request.arguments)], RobotState(state.base + 10.0, state.arm, state.holding)

    monkeypatch.setattr(conduct_module, "refine_action", refine)
    monkeypatch.setattr(conduct_module, "grasp_style", lambda *_: "any")
    physical = SimpleNamespace(action=-1, held=None)
    model = SimpleNamespace(snapshot=lambda: "before")
    return Tries(model, Room({}, {}, {}), physical, {}, {}, BUDGETS, np.random.default_rng(0), True, 3)  # type: ignore[arg-type]


CLOSE, PLACE = act("close", "hinge"), act("place", "cup", "shelf")


@pytest.mark.parametrize(
    ("refuse", "block", "ineffective", "base", "carried_out"),
    [
        (0, 0, 0, 10.0, True),
        (2, 0, 0, 10.0, True),
        (1, 1, 0, 9.0, True),  # back along the way, then there
        (0, 2, 0, 8.0, True),
        (0, 0, 2, 30.0, True),  # it stands in front of the door from then on
        (3, 0, 0, 0.0, False),
        (1, 1, 1, 9.0, False),
        (0, 0, 3, 30.0, False),
    ],
)
def test_an_action_has_its_attempts(
    tries: Tries, refuse: int, block: int, ineffective: int, base: float, carried_out: bool
) -> None:
    tries.refuse, tries.block, tries.ineffective = refuse, block, ineffective
    after, done = tries._act(START, [CLOSE], "start", 0, [])
    assert after is not None and (float(after.base[0]), done) == (base, carried_out)
    kinds = ["no_path"] * refuse + ["path_blocked"] * block + ["condition_not_met"] * ineffective
    assert [failure.kind for failure in tries.failures] == kinds
    assert all(failure.action == "close(hinge)" for failure in tries.failures)


def test_what_is_not_there_is_looked_for_once_and_not_planned_anew(tries: Tries) -> None:
    tries.refuse, tries.reason = 3, "not_found"
    asked: list[int] = []
    assert not tries.run(START, [CLOSE], 2, lambda state, number: asked.append(number), lambda: True)
    assert [failure.kind for failure in tries.failures] == ["not_found"] and not asked


def test_what_was_put_down_wrongly_is_not_in_the_hand_any_more_for_another_try(tries: Tries) -> None:
    tries.ineffective = 1
    after, done = tries._act(RobotState(np.zeros(3), np.zeros(7), "cup"), [PLACE], "start", 0, [])
    assert not done and after is not None and after.holding is None
    assert [failure.kind for failure in tries.failures] == ["condition_not_met"]


def test_a_tray_lost_while_it_is_levelled_is_a_failed_action_and_no_crash(
    tries: Tries, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lose(state: RobotState) -> RobotState:
        raise MotionFailed("grasp_lost", "it slipped")

    tries.model.laden = lambda name: True  # type: ignore[method-assign]
    monkeypatch.setattr(tries, "level", lose)
    after, done = tries._act(START, [act("pick", "tray", "desk")], "start", 0, [])
    assert not done and after is not None and float(after.base[0]) == 9.0  # back along the way
    assert [failure.kind for failure in tries.failures] == ["grasp_lost"]


@pytest.mark.parametrize(("held", "step"), [("cup", PLACE), (None, CLOSE)])
def test_what_is_held_is_looked_at_once_more_from_where_it_is_put_down(
    tries: Tries, monkeypatch: pytest.MonkeyPatch, held: str | None, step: Step
) -> None:
    """It turns in the fingers on the way, whatever the eyes tell."""
    looked: list[str] = []

    def refine(model, state, name, request, origin):  # type: ignore[no-untyped-def]
        return [drive(origin, "there"), act(name, *request.arguments)], state

    def look(before, state, steps, request, origin):  # type: ignore[no-untyped-def]
        looked.append(steps[1].name)
        return steps[1:], state

    monkeypatch.setattr(conduct_module, "refine_action", refine)
    monkeypatch.setattr(tries, "_look_from_there", look)
    tries.physical.held = held
    tries._act(RobotState(np.zeros(3), np.zeros(7), held), [step], "start", 0, [])
    assert looked == (["place"] if held else [])


def test_what_was_lost_on_the_way_cannot_be_placed(tries: Tries) -> None:
    tries.physical.held, tries.block, tries.lose = "cup", 1, True
    after, done = tries._act(RobotState(np.zeros(3), np.zeros(7), "cup"), [PLACE], "start", 0, [])
    assert not done and after is not None and after.holding is None
    assert len(tries.failures) == 1  # no second try with an empty hand


def test_a_door_short_of_where_it_was_pulled_stands_where_it_is(tries: Tries) -> None:
    """Within one action the next motion was planned around the joint; after it all is planned anew."""
    moved: list[tuple[str, float]] = []
    tries.model = SimpleNamespace(owner=lambda joint: "fridge", move_joint=lambda *given: moved.append(given))  # type: ignore[assignment]
    tries.physical.world = SimpleNamespace(joint_value=lambda body, joint: 1.29)
    tries.matches = {"fridge": BodyMatch(body="fridge", matched="fridge_9")}
    tries.joint_names = {"fridge__hinge": "fridge_9__hinge"}

    def pulled(goal: float) -> Step:
        motion = Manipulation(np.zeros(3), (), joint_values={"fridge__hinge": goal})
        return Step("open", ("fridge__hinge",), (), motion)

    with pytest.raises(MotionFailed, match=r"stands at 1\.290 instead of 1\.400"):
        tries._check_joints(pulled(1.4), ended=False)
    assert not moved
    tries._check_joints(pulled(1.4), ended=True)
    tries._check_joints(pulled(1.31), ended=True)
    assert moved == [("fridge__hinge", 1.29)]


# --- looks at a room ------------------------------------------------------------------------------------------


@pytest.fixture
def looking(scene: Path, kitchen_model: WorldModel) -> Iterator[Conduct]:
    """The kitchen as it is believed to be, and as it is: the same at first."""
    model, before = kitchen_model, kitchen_model.snapshot()
    bodies = read_scene_bodies(scene)
    room = Room(
        {name: record for name, (record, _) in bodies.items()},
        {name: text for name, (_, text) in bodies.items()},
        {name: () for name in bodies},
    )
    matches = {name: BodyMatch(body=name, matched=name) for name in bodies}
    with load_scene(scene) as world:
        physical = SimpleNamespace(world=world, held=None, action=-1)
        joints = {"fridge_2__hinge": "fridge_2__hinge"}
        eyes = TrueEyes(model, room, physical, joints)  # type: ignore[arg-type]
        yield Conduct(model, room, physical, matches, joints, BUDGETS, np.random.default_rng(0), True, 1, eyes=eyes)  # type: ignore[arg-type]
    model.restore(before)


def put(world: PhysicsWorld, pose: np.ndarray) -> None:
    """Let the bottle (6 cm wide, 20 cm high, its origin on its foot) come to rest."""
    world.set_pose("bottle_7", pose)
    world.wake()
    world.step(60)


ON_TABLE = np.array([-1.3, -1.1, 0.751])


def lying() -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]  # its axis along x
    pose[:3, 3] = ON_TABLE + [0.0, 0.0, 0.03]
    return pose


def test_what_stands_where_it_was_put_is_left_alone(looking: Conduct) -> None:
    put(looking.physical.world, transform_from_yaw(0.5, ON_TABLE))
    looking._check_effect("place", ("bottle_7", "table_3"))
    looking._check_effect("pick", ("bottle_7", "fridge_2"))  # of a pick there is nothing to see here


def test_what_stands_elsewhere_is_a_failure(looking: Conduct) -> None:
    put(looking.physical.world, transform_from_yaw(0.0, np.array([0.0, 0.0, 0.001])))
    with pytest.raises(MotionFailed, match="is now on floor_1") as raised:
        looking._check_effect("place", ("bottle_7", "table_3"))
    failure = raised.value.failure
    assert failure.kind == "condition_not_met" and failure.objects == ("bottle_7", "table_3")
    assert failure.numbers["tilt"] < 0.01


def test_what_is_on_nothing_is_a_failure(looking: Conduct) -> None:
    looking.physical.world.set_pose("bottle_7", transform_from_yaw(0.0, ON_TABLE + [0.0, 0.0, 0.3]))
    looking.physical.world.step(2)
    with pytest.raises(MotionFailed, match="is now on nothing"):
        looking._check_effect("place", ("bottle_7", "table_3"))


def test_what_fell_over_is_a_failure(looking: Conduct) -> None:
    put(looking.physical.world, lying())
    with pytest.raises(MotionFailed, match="on table_3, 90 degrees") as raised:
        looking._check_effect("place", ("bottle_7", "table_3"))
    assert raised.value.failure.numbers["tilt"] == pytest.approx(np.pi / 2, abs=0.02)
    assert raised.value.failure.numbers["tilt"] > MOST_TILT


def test_what_was_upside_down_or_lying_is_put_down_so(looking: Conduct) -> None:
    """As it was last seen: a bottle that lay may lie, one that stood on its head has to."""
    record = looking.model.records["bottle_7"]
    fallen = tuple(tuple(row) for row in lying().tolist())
    looking.model.records["bottle_7"] = record.model_copy(update={"world_from_body": fallen})
    put(looking.physical.world, lying())
    looking._check_effect("place", ("bottle_7", "table_3"))
    over = transform_from_yaw(0.3, ON_TABLE + [0.0, 0.0, 0.2]) @ np.diag([1.0, -1.0, -1.0, 1.0])
    upside_down = tuple(tuple(row) for row in over.tolist())
    looking.model.records["bottle_7"] = record.model_copy(update={"world_from_body": upside_down})
    put(looking.physical.world, over)
    looking._check_effect("place", ("bottle_7", "table_3"))
    put(looking.physical.world, transform_from_yaw(0.0, ON_TABLE))
    with pytest.raises(MotionFailed, match="180 degrees"):
        looking._check_effect("place", ("bottle_7", "table_3"))


def test_a_look_around_sees_what_moves(looking: Conduct) -> None:
    """The bottle has moved, the fridge's door is nearly shut; the cup is in the hand: its shape is known from before,
    and so is the table."""
    world, model = looking.physical.world, looking.model
    world.set_pose("bottle_7", transform_from_yaw(0.5, ON_TABLE))
    world.set_joint("fridge_2", "fridge_2__hinge", 0.25)
    world.set_pose("cup_5", transform_from_yaw(0.0, np.array([0.0, 0.0, 1.2])))
    parents = {name: record.parent for name, record in model.records.items()}
    looking.physical.held = "cup_5"  # type: ignore[misc]
    looking.matches["ghost_4"] = BodyMatch(body="ghost_4", matched=None)
    known = {name: model.world.bodies[name] for name in ("table_3", "cup_5")}
    looking.look_around()
    np.testing.assert_allclose(model.pose("bottle_7"), transform_from_yaw(0.5, ON_TABLE), atol=1e-6)
    assert model.joint_value("fridge_2", "fridge_2__hinge") == pytest.approx(0.25)
    np.testing.assert_allclose(model.pose("cup_5"), world.pose("cup_5"), atol=1e-9)
    assert all(model.world.bodies[name] is body for name, body in known.items())
    assert {name: record.parent for name, record in model.records.items()} == parents
    assert model.records["bottle_7"].movable


# --- a laden tray in the hand ---------------------------------------------------------------------------------


@pytest.fixture
def carrying(looking: Conduct) -> Conduct:
    """The cup stands on the bottle (the carrier here), which is in the hand and was lifted with it."""
    world, model = looking.physical.world, looking.model
    for entry in (world, model.world):
        entry.set_pose("bottle_7", transform_from_yaw(0.0, ON_TABLE))
        entry.set_pose("cup_5", transform_from_yaw(0.0, ON_TABLE + [0.0, 0.0, 0.201]))
    model.put_on("cup_5", "bottle_7")
    model.take_aboard("bottle_7")
    lift = transform_from_yaw(0.0, np.array([0.3, 0.2, 0.25]))
    for name in ("bottle_7", "cup_5"):
        world.set_pose(name, lift @ world.pose(name))
    looking.physical.held = "bottle_7"  # type: ignore[misc]
    looking.physical.held_pose = lambda: np.eye(4)  # type: ignore[method-assign]
    return looking


HOLDING = RobotState(np.zeros(3), np.zeros(7), "bottle_7", np.eye(4), np.eye(4))


def cup_over_bottle(model: WorldModel) -> np.ndarray:
    return (np.linalg.inv(model.pose("bottle_7")) @ model.pose("cup_5"))[:3, 3]


def test_a_place_without_a_motion_leaves_the_load_on_its_tray(
    carrying: Conduct, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second attempt has to carry as level as the first."""
    laden = []

    def refuse(self, model, *_):  # type: ignore[no-untyped-def]
        laden.append(model.laden("bottle_7"))
        raise MotionFailed("no_path", "no way")

    monkeypatch.setattr(Place, "manipulate", refuse)
    carrying.attempts = 3
    carrying._anchor = lambda step: None  # type: ignore[method-assign]
    after, done = carrying._act(HOLDING, [act("place", "bottle_7", "table_3")], "start", 0, [])
    assert not done and after is HOLDING
    assert laden == [True, True, True] and carrying.model.laden("bottle_7")
    np.testing.assert_allclose(cup_over_bottle(carrying.model), [0.0, 0.0, 0.201], atol=1e-6)


def test_what_was_to_be_put_down_and_is_still_in_the_hand_keeps_its_load(carrying: Conduct) -> None:
    """The model had put both on the table when the motion was found; then the arm was stopped on the way."""
    model, world = carrying.model, carrying.physical.world
    model.world.set_pose("bottle_7", transform_from_yaw(0.0, ON_TABLE))
    model.set_down()
    world.set_pose("cup_5", transform_from_yaw(0.0, np.array([0.0, 0.02, 0.0])) @ world.pose("cup_5"))  # it slid
    world.step(1)
    assert carrying._perceive(HOLDING).holding == "bottle_7" and model.laden("bottle_7")
    np.testing.assert_allclose(cup_over_bottle(model), [0.0, 0.02, 0.201], atol=1e-3)


def test_what_fell_off_is_no_load_any_more(carrying: Conduct) -> None:
    model, world = carrying.model, carrying.physical.world
    world.set_pose("cup_5", transform_from_yaw(0.0, np.array([0.5, 0.5, 0.001])))
    world.step(5)
    carrying._perceive(HOLDING)
    assert not model.laden("bottle_7") and model.records["cup_5"].parent == "floor_1"
    np.testing.assert_allclose(model.pose("cup_5"), world.pose("cup_5"), atol=1e-6)


def test_a_look_around_sees_what_stands_on_what_is_held(carrying: Conduct) -> None:
    model, world = carrying.model, carrying.physical.world
    world.set_pose("cup_5", transform_from_yaw(0.0, np.array([0.0, 0.02, 0.0])) @ world.pose("cup_5"))
    carrying.look_around()
    for name in ("cup_5", "bottle_7"):
        np.testing.assert_allclose(model.pose(name), world.pose(name), atol=1e-6)
    model.take_aboard("bottle_7")
    np.testing.assert_allclose(cup_over_bottle(model), [0.0, 0.02, 0.201], atol=1e-6)


class Looking(Conduct):
    """Drives take no time, looks show nothing new."""

    driven: list[float]

    def _execute(self, step: Step) -> None:
        self.driven.append(float(step.segments[-1].path[-1, 0]))

    def _perceive(self, state: RobotState) -> RobotState:
        return state

    def _look_again(self, step, before):  # type: ignore[no-untyped-def]
        return None


def test_where_nothing_serves_from_there_it_drives_on_and_looks_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """From 1 m along nothing can be grasped, from 2 m it can: by a look from there, with the size it then has."""
    room = Room({}, {}, {})
    model = SimpleNamespace(
        restore=lambda before: None,
        snapshot=lambda: None,
        pose=lambda body: np.eye(4),
        text=lambda body: "",
        links=lambda body: (),
        checker=SimpleNamespace(allow=lambda touch: None, put_down=lambda: None),
    )
    physical = SimpleNamespace(action=-1, held=None)
    conduct = Looking(model, room, physical, {}, {}, BUDGETS, np.random.default_rng(0), True, 2)  # type: ignore[arg-type]
    conduct.driven = []
    asked: list[tuple[float, bool]] = []

    def drive_to(x: float) -> Step:
        return Step("drive", ("start", "cup"), (Segment(np.array([[x, *np.zeros(9)]]), 0.0),), None)

    def refined(model, state, name, request, origin):  # type: ignore[no-untyped-def]
        asked.append((float(state.base[0]), request.base is not None))
        if request.base is not None and state.base[0] < 2.0:
            raise MotionFailed("no_path", "not from here", ("cup",))
        return [act("pick", "cup", "table")] if request.base is not None else [drive_to(2.0), PLAN[1]], state

    monkeypatch.setattr(conduct_module, "refine_action", refined)
    request = MotionRequest(("cup", "table"), replace(BUDGETS, size_uncertainty=0.02), np.random.default_rng(0))
    steps, _ = conduct._look_from_there(None, START, [drive_to(1.0), PLAN[1]], request, "start")  # type: ignore[arg-type]
    assert [step.name for step in steps] == ["pick"]
    assert conduct.driven == [1.0, 2.0]
    assert asked == [(1.0, True), (1.0, False), (2.0, True)]
