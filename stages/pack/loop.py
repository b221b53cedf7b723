"""The loop of LLM3 (Han 2024, algorithm 1): a proposer says a whole plan, motion planning says what is wrong with it.

The world is reset at every iteration and the whole plan executed again. What a plan shares with the one before, up to
where that failed, keeps its motions and is not counted; every other action that reaches the motion planner counts as
one call, also when inverse kinematics or the collision check refuse it.
"""

from __future__ import annotations

from dataclasses import dataclass

from scenewright.schemas.plan import Failure
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.pack.environment import PackingWorld, State, WrongAction
from scenewright.stages.pack.motion import Motion
from scenewright.stages.pack.records import Action, Attempt, Proposer, StepFeedback

ITERATIONS = 20
"""Cap of proposer calls of the thesis."""


class GaveUp(Exception):
    """Raised by a proposer that will propose nothing more: a language model's budget is spent, nobody answers."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(failure.message)
        self.failure = failure


@dataclass(frozen=True)
class Budget:
    """When the loop gives up."""

    iterations: int = ITERATIONS
    motion_calls: int = 1_000_000


@dataclass(frozen=True)
class PackingRun:
    """What the loop came to."""

    success: bool
    proposer_calls: int
    motion_calls: int
    mesh_calls: int
    """Motion-planner calls among them whose path closed forms did not decide."""
    attempts: tuple[Attempt, ...]
    states: tuple[State, ...]
    """The initial state and the one after each action of the last attempt that was carried out."""
    motions: tuple[Motion, ...]
    """The motions of that attempt."""
    stopped: Failure | None = None
    """Why the proposer gave up."""

    @property
    def plan(self) -> tuple[Action, ...]:
        """The plan that reached the goal, empty when none did."""
        return self.attempts[-1].actions if self.success else ()


def run_loop(world: PackingWorld, proposer: Proposer, budget: Budget) -> PackingRun:
    """Ask the proposer until a plan reaches the goal or a budget is spent."""
    observation = world.instance.observation
    attempts: list[Attempt] = []
    done: list[tuple[Action, State, Motion]] = []
    """What the plan before carried out."""
    motion_calls = 0
    mesh_before = world.planner.mesh_calls
    success = False
    stopped: Failure | None = None
    calls_before = proposer.calls
    while not success and len(attempts) < budget.iterations and motion_calls < budget.motion_calls:
        try:
            actions = proposer.propose(observation, tuple(attempts))
        except GaveUp as end:
            stopped = end.failure
            break
        shared = 0
        while shared < min(len(done), len(actions)) and done[shared][0] == actions[shared]:
            shared += 1
        done = done[:shared]
        state = done[-1][1] if done else world.initial
        feedback = [StepFeedback(action) for action, _, _ in done]
        failure: Failure | None = None
        for action in actions[shared:]:
            try:
                motion_calls += 1
                state, motion = world.step(state, action)
            except MotionFailed as failed:
                failure = failed.failure
            except WrongAction as wrong:
                motion_calls -= 1
                failure = wrong.failure
            feedback.append(StepFeedback(action, failure))
            if failure is not None:
                break
            done.append((action, state, motion))
        task = None
        if failure is None:
            # A plan that seems to reach the goal is carried out once more with physics after every place.
            outside = world.outside(state) or world.confirm(actions)
            success = not outside
            if outside:
                task = Failure(
                    kind="not_in_basket",
                    message="; ".join(f"{name} is not in the basket" for name in outside),
                    objects=outside,
                )
        attempts.append(Attempt(actions, tuple(feedback), task))
    return PackingRun(
        success,
        proposer.calls - calls_before,
        motion_calls,
        world.planner.mesh_calls - mesh_before,
        tuple(attempts),
        (world.initial, *(entry[1] for entry in done)),
        tuple(entry[2] for entry in done),
        stopped,
    )
