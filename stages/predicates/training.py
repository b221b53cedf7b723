"""Training: episodes with a teacher, in which a learner plans with what it knows and tries what it does not know."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from scenewright.stages.kit.predicates.goal_words import goal_phrases
from scenewright.stages.kit.predicates.vocabulary import Perceived
from scenewright.stages.kit.tasks.strips import Atom, Domain, Problem, ground
from scenewright.stages.kit.tasks.task_planner import plan_task
from scenewright.stages.predicates.execution import (
    MOST_FAILURES,
    MOST_STEPS,
    PLANNING_LIMIT,
    SHORTENING,
    Live,
    World,
    action_atom,
)
from scenewright.stages.predicates.learning.memory import Memory
from scenewright.stages.predicates.learning.ours import OursLearner
from scenewright.stages.predicates.tasks import Task, open_kitchen
from scenewright.stages.predicates.teacher.simulated import TeacherLeft

LEFT_FOR_THE_GOAL = 8
"""Steps of an episode that are kept for its goal; before them whatever was never tried comes first."""


Opened = Callable[[Task], World]
"""Task -> the world that it begins in."""


def in_the_kitchen(task: Task) -> World:
    """Return the kitchen of a task."""
    return Live(open_kitchen(task))


@dataclass
class Training:
    """How training went."""

    episodes: int = 0
    reached: int = 0
    actions: int = 0
    refused: int = 0
    physics: list[str] = field(default_factory=list)
    """Actions that the teacher allowed and physics failed."""
    course: list[tuple[int, int, int]] = field(default_factory=list)
    """After each step: predicates that were learned, actions that were done, sentences that were heard."""

    def note(self, memory: Memory) -> None:
        """Keep how far learning has come."""
        self.course.append((len(set(memory.names().values())), len(memory.transitions), memory.sentences))


def train(learner: OursLearner, domain: str, tasks: Sequence[Task], opened: Opened = in_the_kitchen) -> Training:
    """Let a learner work through tasks with its teacher, until she leaves."""
    training = Training()
    for task in tasks:
        reached = training.reached
        try:
            _episode(learner, domain, task, opened(task), training)
            training.note(learner.memory)
            training.episodes += 1
            if training.reached == reached:
                learner.reconsider()
        except TeacherLeft:
            break
    return training


def _episode(learner: OursLearner, domain: str, task: Task, world: World, training: Training) -> None:
    memory = learner.memory
    phrases = goal_phrases(task.sentence, task.objects)
    failures = 0
    learner.sought = None
    for step in range(MOST_STEPS):
        if failures >= MOST_FAILURES:
            return
        if step:
            training.note(memory)
        state = world.state()
        goal, _ = memory.goal_atoms(phrases)
        curious = step < MOST_STEPS - LEFT_FOR_THE_GOAL and learner.curious(state)
        if goal <= memory.see(state) and not (
            goal and curious
        ):  # also when nothing is known of the goal: then it is asked for
            if learner.teacher.satisfied(state, task.goal):
                learner.reached(state, phrases)
                training.reached += 1
                return
            learner.unmet(state, phrases, learner.teacher.unmet(state, task.goal))
            continue
        action = _next_action(learner, domain, state, goal, curious)
        if action is None:
            return
        training.actions += 1
        if not learner.teacher.allows(state, action):
            training.refused += 1
            failures += 1
            learner.refused(state, action, learner.teacher.correct(state, action))
            continue
        reason = world.do(action)
        if reason:
            training.physics.append(f"{' '.join(action)}: {reason}")
            failures += 1
            continue
        failures = 0
        learner.allowed(state, action, world.state())


def _next_action(
    learner: OursLearner, domain: str, state: Perceived, goal: frozenset[Atom], curious: bool
) -> Atom | None:
    """Return what to do: something never tried while there is time, or whenever there is no plan; else the plan's
    start."""
    tried = learner.explore(state)
    if curious or not learner.plans:
        return tried
    operators, atoms = learner.memory.domain(domain), learner.memory.see(state)
    planned = first_action(operators, list(state.names), atoms, goal)
    if planned is not None:
        return planned
    fresh = tried if learner.little_tried(state, tried) else None
    return _towards_unknown(learner, operators, state, atoms) or fresh or learner.doubtful(state) or tried


def _towards_unknown(learner: OursLearner, operators: Domain, state: Perceived, held: frozenset[Atom]) -> Atom | None:
    """Return the next step of the best way to where an action can be tried that may be what the goal lacks. What was
    chosen is kept to until it was tried or there is no way to it."""
    if learner.sought is None:
        learner.sought = _best_sought(learner, operators, state, held)
    if learner.sought is None:
        return None
    action, sought_atoms = learner.sought
    if sought_atoms <= held:
        learner.sought = None
        return action
    plan = _plan(operators, list(state.names), held, sought_atoms, improvement=0)
    if not plan:
        learner.sought = None
        return None
    return plan[0]


def _best_sought(
    learner: OursLearner, operators: Domain, state: Perceived, held: frozenset[Atom]
) -> tuple[Atom, frozenset[Atom]] | None:
    best: tuple[tuple[int, ...], Atom, frozenset[Atom]] | None = None
    for order, action, sought_atoms in sorted(learner.worth_trying(state), key=lambda entry: entry[:2]):
        if best is not None and best[0][:-1] < order:
            break
        far = 0 if sought_atoms <= held else len(_plan(operators, list(state.names), held, sought_atoms, improvement=0))
        if (far or sought_atoms <= held) and (best is None or (*order, far) < best[0]):
            best = ((*order, far), action, sought_atoms)
    if best is None:
        return None
    learner.seeking[best[1:]] += 1
    return best[1:]


def first_action(domain: Domain, objects: Sequence[str], atoms: frozenset[Atom], goal: frozenset[Atom]) -> Atom | None:
    """Return the first action of a plan, None without one."""
    plan = _plan(domain, objects, atoms, goal, SHORTENING)
    return plan[0] if plan else None


def _plan(
    domain: Domain, objects: Sequence[str], atoms: frozenset[Atom], goal: frozenset[Atom], improvement: int
) -> list[Atom]:
    problem = Problem("task", dict.fromkeys(objects, ""), atoms, goal)
    outcome = plan_task(problem, ground(domain, problem), limit=PLANNING_LIMIT, improvement=improvement)
    return [action_atom(action) for action in outcome.actions or ()]
