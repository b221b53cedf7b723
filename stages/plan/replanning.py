"""Planning again in the middle of an execution: from what a look around the room shows, for the same goal.

An action that failed in all its attempts, or a goal that does not hold at the end, leaves the room in a state that the
plan did not foresee: a cup lies on its side, a can stands beside the tray. The robot then looks at everything that the
planned scene knows and searches from there (closed loop, as in Han 2024, chapter 3).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.plan import Failure, TriedPlan
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.tasks.strips import Atom, GroundAction, Problem
from scenewright.stages.plan.believed_tree import TreeState
from scenewright.stages.plan.reading import Reading
from scenewright.stages.plan.refinement import Attempt, Step
from scenewright.stages.plan.symbols import symbolic_state
from scenewright.stages.plan.tree_state import graph_of_state
from scenewright.stages.plan.world_model import RobotState, WorldModel

Search = Callable[[RobotState, tuple[Problem, list[GroundAction]]], Attempt]
"""Task and motion planning from a robot's state, in the model as it is."""


@dataclass
class Replanning:
    """The search for another way to a goal, and what came of it so far."""

    model: WorldModel
    graph: ContactGraphFile
    """Of the planned scene."""
    believed: TreeState
    """At the beginning, in the planned scene."""
    literals: tuple[str, ...]
    reading: Reading
    search: Search
    failures: list[Failure] = field(default_factory=list)
    tried: list[TriedPlan] = field(default_factory=list)
    learned: list[str] = field(default_factory=list)
    places: list[int] = field(default_factory=list)
    """Index of the first step of each plan made here."""

    def plan(self, state: RobotState, start: TreeState, observed: TreeState, number: int) -> list[Step] | None:
        """Return steps from an observed state on, None when there are none; failures are collected.

        `start` is what was observed before the first action, `number` the index that the first new step will have. The
        model has been brought to what was observed.
        """
        graph = graph_of_state(self.graph, start, observed, self.believed, self.model)
        for name, parent in observed.parents.items():
            if name in self.model.records and parent in self.model.records:
                self.model.put_on(name, parent)
        objects, initial = symbolic_state(self.model, graph)
        initial = in_the_middle(initial, state.holding, start, observed)
        problem = self.reading.problem(self.model, graph, objects, initial, self.literals)
        if state.holding is not None:
            self.model.take_aboard(state.holding)
        try:
            attempt = self.search(state, self.reading.task(self.model, problem))
        except MotionFailed as failed:
            self.failures.append(failed.failure)
            return None
        self.failures += attempt.failures
        self.tried += attempt.tried
        self.learned += attempt.learned
        if attempt.steps is not None:
            self.places.append(number)
        return attempt.steps


def in_the_middle(
    initial: frozenset[Atom], holding: str | None, start: TreeState, observed: TreeState
) -> frozenset[Atom]:
    """Return the atoms of a first state as they are in the middle of an execution.

    What stands on something else than at the beginning has been moved; what the hand holds stands nowhere.
    """
    moved = {name for name, parent in observed.parents.items() if start.parents.get(name) != parent}
    atoms = {atom for atom in initial if not (atom[0] == "unmoved" and atom[1] in moved)}
    if holding is None:
        return frozenset(atoms)
    stands = {atom for atom in atoms if atom[0] in ("on", "in", "behind", "carried_along") and atom[1] == holding}
    return frozenset((atoms - stands - {("hand_empty",)}) | {("holding", holding)})
