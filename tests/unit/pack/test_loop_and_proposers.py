"""What counts as a call, what proposers make of feedback, and that hard problems can be solved."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from scenewright.schemas.errors import UsageError
from scenewright.schemas.plan import Failure
from scenewright.stages.pack import hard_suites
from scenewright.stages.pack.backtracking import Backtracking
from scenewright.stages.pack.environment import PackingWorld
from scenewright.stages.pack.hard_suites import HARD_CELLS, hard_instance
from scenewright.stages.pack.instances import Instance, Obstacle, Rectangle, published_instance
from scenewright.stages.pack.layout_search import LayoutProblem, find_layout
from scenewright.stages.pack.learned_limits import learn
from scenewright.stages.pack.loop import Budget, GaveUp, run_loop
from scenewright.stages.pack.motion import MotionPlanner
from scenewright.stages.pack.own_proposer import OwnProposer, placement_solver
from scenewright.stages.pack.records import Action, Attempt, BoxState, StepFeedback
from scenewright.stages.pack.sampling import FixedLayout, RandomRestarts, RandomSampler, pick_and_place

EASY = ("red_box", "blue_box", "green_box", "tan_box")


@pytest.fixture(scope="module")
def planner() -> Iterator[MotionPlanner]:
    made = MotionPlanner()
    yield made
    made.close()


class Recited:
    """Says the plans it was given, one after the other, then gives up."""

    name = "recited"

    def __init__(self, *plans: tuple[Action, ...]) -> None:
        self.calls, self._plans = 0, plans

    def propose(self, observation: object, trace: object) -> tuple[Action, ...]:
        if self.calls >= len(self._plans):
            raise GaveUp(Failure(kind="out_of_words", message="nothing more to say"))
        self.calls += 1
        return self._plans[self.calls - 1]


def _plan(*spots: tuple[str, float, float]) -> tuple[Action, ...]:
    return tuple(action for name, x, y in spots for action in pick_and_place(name, x, y, 0.0))


GOOD = (("red_box", 0.59, 0.06), ("blue_box", 0.68, 0.06), ("green_box", 0.59, -0.06), ("tan_box", 0.68, -0.06))


def test_an_unchanged_prefix_is_carried_over_and_not_counted(planner: MotionPlanner) -> None:
    bad = (*GOOD[:3], ("tan_box", 0.68, 0.06))
    with PackingWorld(published_instance("easy", 3), planner=planner) as world:
        result = run_loop(world, Recited(_plan(*bad), _plan(*bad), _plan(*GOOD)), Budget(20))
    # 8 in the first plan; then only the action that failed, twice: what failed has no motion to keep.
    assert (result.success, result.proposer_calls, result.motion_calls) == (True, 3, 8 + 1 + 1)
    assert [len(attempt.feedback) for attempt in result.attempts] == [8, 8, 8]
    assert result.attempts[0].feedback[-1].failure.objects == ("blue_box", "tan_box")  # type: ignore[union-attr]
    assert len(result.states) == 9 and len(result.motions) == 8


def test_what_never_reaches_the_motion_planner_is_not_counted(planner: MotionPlanner) -> None:
    place_first = (Action("place", "red_box", 0.6, 0.0, 0.0),)
    invented = (Action("pick", "pink_box"),)
    twice = (Action("pick", "red_box"), Action("pick", "blue_box"))
    with PackingWorld(published_instance("easy", 3), planner=planner) as world:
        result = run_loop(world, Recited(place_first, invented, twice, ()), Budget(20))
    kinds = [attempt.feedback[-1].failure.kind for attempt in result.attempts[:3]]  # type: ignore[union-attr]
    assert kinds == ["wrong_order", "unknown_object", "wrong_order"]
    assert result.motion_calls == 1 and not result.success
    assert result.attempts[3].task is not None and set(result.attempts[3].task.objects) == set(EASY)
    assert result.stopped is not None and result.stopped.kind == "out_of_words"


def test_parameters_out_of_range_are_clipped_not_refused(planner: MotionPlanner) -> None:
    plan = (Action("pick", "red_box"), Action("place", "red_box", 0.6, 0.05, 40.0))
    with PackingWorld(published_instance("easy", 3), planner=planner) as world:
        result = run_loop(world, Recited(plan), Budget(1))
        assert world.box(result.states[-1], "red_box").yaw == pytest.approx(3.14)


@pytest.mark.parametrize("cell", ["easy", "medium", "hard", "hard_medium_basket", "hard_large_basket"])
@pytest.mark.slow
def test_ours_and_the_fixed_layout_solve_the_published_suite(planner: MotionPlanner, cell: str) -> None:
    with PackingWorld(published_instance(cell, 11), planner=planner) as world:
        for proposer in (OwnProposer(), FixedLayout()):
            result = run_loop(world, proposer, Budget(20))
            assert (result.success, result.proposer_calls, result.motion_calls) == (True, 1, 8)


def test_samplers_are_seeded_and_restart(planner: MotionPlanner) -> None:
    for kind in (RandomSampler, RandomRestarts, Backtracking):
        results = []
        for _ in range(2):
            with PackingWorld(published_instance("easy", 2), planner=planner) as world:
                results.append(run_loop(world, kind(9), Budget(1000, 2000)))
        assert results[0].success and results[0].attempts == results[1].attempts


@pytest.mark.parametrize("cell", sorted(HARD_CELLS))
def test_hard_instances_are_certified_and_ours_solves_them(planner: MotionPlanner, cell: str) -> None:
    instance = hard_instance(cell, 4)
    assert instance == hard_instance(cell, 4)
    with PackingWorld(instance, planner=planner) as world:
        assert run_loop(world, Recited(instance.certificate), Budget(1)).success
        result = run_loop(world, OwnProposer(), Budget(20))
    assert result.success and result.motion_calls <= 4 * len(instance.boxes)


def test_a_hard_instance_that_cannot_be_certified_is_an_error_of_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hard_suites, "_certify", lambda *_: None)
    with pytest.raises(UsageError, match="hard/fill: number 4 has no certified problem") as refused:
        hard_instance("fill", 4)
    assert refused.value.hint and "\n" not in str(refused.value)


def test_ours_learns_the_reach_and_the_height_of_an_obstacle(planner: MotionPlanner) -> None:
    boxes = tuple(BoxState(name, 0.07, 0.07, 0.07, 0.4, -0.4 + 0.25 * k, 0.0, False) for k, name in enumerate(EASY[:3]))
    post = Obstacle(Rectangle("post_1", (0.62, -0.06), (0.66, 0.0)), 0.16)
    instance = Instance("own", boxes, Rectangle("basket", (0.62, -0.06), (0.90, 0.10)), (post,))
    with PackingWorld(instance, planner=planner) as world:
        tall = run_loop(world, Recited(pick_and_place("red_box", 0.70, -0.02, np.pi / 2)), Budget(1))
        limits = learn(instance.observation, tall.attempts, True)
        assert 0.07 < limits.tops["post_1"] <= 0.16
        far = run_loop(world, Recited(_plan(("red_box", 0.86, 0.0))), Budget(1))
        limits = learn(instance.observation, far.attempts, True)
        assert limits.reach == pytest.approx(planner.arm.reach(0.1) - 0.001, abs=1e-5)


def test_the_order_is_kept_when_a_model_chose_it(planner: MotionPlanner) -> None:
    order = ("tan_box", "blue_box", "red_box", "green_box")
    with PackingWorld(published_instance("hard", 1), planner=planner) as world:
        plan = placement_solver(world.instance.observation, order, ())
        assert not isinstance(plan, Failure)
        assert tuple(action.box for action in plan if action.name == "pick") == order
        assert run_loop(world, Recited(plan), Budget(1)).success
        unknown = placement_solver(world.instance.observation, ("pink_box",), ())
        assert isinstance(unknown, Failure) and unknown.kind == "unknown_object"


def test_without_reasons_nothing_but_the_failed_action_is_read() -> None:
    instance = published_instance("hard", 1)
    plan = _plan(("red_box", 0.6, 0.0))
    failures = (
        Failure(kind="no_inverse_kinematics", message="x", numbers={"nearest_x": 0.5, "nearest_y": 0.0, "distance": 1}),
        Failure(kind="goal_in_collision", message="y", objects=("blue_box", "red_box"), numbers={"depth": 0.01}),
    )
    learnt = []
    for failure in failures:
        attempt = Attempt(plan, (StepFeedback(plan[0]), StepFeedback(plan[1], failure)))
        learnt.append(learn(instance.observation, (attempt,), False))
    assert learnt[0] == learnt[1]
    assert learnt[0].reach == np.inf and learnt[0].refused[0][0] == "red_box"


def _problem(extents: list[tuple[float, float]], side: tuple[float, float], reach: float = np.inf) -> LayoutProblem:
    count = len(extents)
    return LayoutProblem(
        extents=np.array(extents),
        container=np.array([0.0, 0.0, *side]),
        fixed=np.zeros((0, 4)),
        hand=np.zeros((2, 1, 4)),
        over_fixed=np.zeros((count, 0, 1), dtype=bool),
        over_boxes=np.zeros((count, count, 1), dtype=bool),
        reach=reach,
        refused=np.zeros((0, 5)),
    )


def test_the_layout_search_fills_a_container_almost_wholly() -> None:
    # Nine of a 3 x 3 grid, and a guillotine cut that needs turned boxes.
    grid = find_layout(_problem([(0.1, 0.1)] * 9, (0.31, 0.31)), 0.001, np.random.default_rng(0))
    assert grid is not None
    turned = find_layout(
        _problem([(0.3, 0.1), (0.2, 0.1), (0.2, 0.1)], (0.303, 0.303)), 0.001, np.random.default_rng(0)
    )
    assert turned is not None
    for layout, sides in ((grid, [(0.1, 0.1)] * 9), (turned, [(0.3, 0.1), (0.2, 0.1), (0.2, 0.1)])):
        for i, (x, y, turn) in enumerate(layout):
            for j in range(i):
                gap_x = abs(x - layout[j][0]) - (sides[i][int(turn)] + sides[j][int(layout[j][2])]) / 2
                gap_y = abs(y - layout[j][1]) - (sides[i][1 - int(turn)] + sides[j][1 - int(layout[j][2])]) / 2
                assert max(gap_x, gap_y) >= 0.001 - 1e-8


def test_the_layout_search_says_when_there_is_none() -> None:
    random = np.random.default_rng(0)
    assert find_layout(_problem([(0.2, 0.2), (0.2, 0.2)], (0.3, 0.3)), 0.0, random) is None
    near = _problem([(0.1, 0.1)], (0.3, 0.3), reach=0.06)
    assert find_layout(near, 0.0, random) is None
    within = find_layout(_problem([(0.1, 0.1)] * 2, (0.5, 0.1), reach=0.3), 0.0, random)
    assert within is not None and np.hypot(within[:, 0], within[:, 1]).max() <= 0.3
