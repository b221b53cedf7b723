"""The step `plan`: symbols and geometry in the planned scene, execution in physics, checks, pictures."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import UsageError
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.language_map import LanguageMap
from scenewright.schemas.plan import Failure, Plan, PlanFile, PlannedAction, TriedPlan
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.formats.trajectories import read_tum
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.kit.motion.failures import MotionFailed, end_in_collision
from scenewright.stages.kit.simulation.margins import is_marginal
from scenewright.stages.kit.simulation.robot_description import RobotDescription, load_robot
from scenewright.stages.kit.stage import Context
from scenewright.stages.kit.tasks.pddl import domain_text, problem_text
from scenewright.stages.kit.tasks.strips import Atom, Problem
from scenewright.stages.plan.assumptions import believe, parse_priors
from scenewright.stages.plan.check_margins import verdict_margin
from scenewright.stages.plan.domain import DOMAIN
from scenewright.stages.plan.given_domain import read_given_domain
from scenewright.stages.plan.goals import TABLE_CLASSES, default_goals
from scenewright.stages.plan.open_goals import has_words, named_goal
from scenewright.stages.plan.parameters import STAND, PlanParameters
from scenewright.stages.plan.pick_place import Budgets
from scenewright.stages.plan.plan_text import plan_text
from scenewright.stages.plan.reading import Reading
from scenewright.stages.plan.refinement import SearchSettings, Step, plan_and_refine
from scenewright.stages.plan.room_execution import Order, Outcome, execute, only_planned
from scenewright.stages.plan.start_pose import start_base
from scenewright.stages.plan.symbols import symbolic_state, task_problem
from scenewright.stages.plan.tasks import task_goals
from scenewright.stages.plan.trajectories import planned_rows, write_trajectory
from scenewright.stages.plan.world_model import RobotState, WorldModel

Status = Literal["executed", "planned", "infeasible", "execution_failed"]
START, SEARCH, EXECUTION, REPLANNING = 1, 2, 3, 4
"""Random streams."""


@dataclass
class Found:
    """What planning found: the goal that was chosen and its steps (None: there are none), and what it took."""

    literals: tuple[str, ...] = ()
    problem: Problem | None = None
    steps: list[Step] | None = None
    failures: list[Failure] = field(default_factory=list)
    tried: list[TriedPlan] = field(default_factory=list)
    learned: list[str] = field(default_factory=list)
    ungrounded: tuple[str, ...] = ()
    """What a given domain speaks of and nothing here stands for."""


@dataclass(frozen=True)
class Scene:
    """What is planned in: the model, its graph, and what is true of it at the beginning."""

    model: WorldModel
    graph: ContactGraphFile
    objects: dict[str, str]
    initial: frozenset[Atom]
    reading: Reading

    def problem(self, literals: tuple[str, ...]) -> Problem:
        """Return the task of ground literals."""
        return self.reading.problem(self.model, self.graph, self.objects, self.initial, literals)


def run(
    scene: InteractiveScene,
    ground_truth: GroundTruth | None,
    domain: Path | None,
    language: LanguageMap | None = None,
    sequence: Sequence | None = None,
    *,
    parameters: PlanParameters,
    context: Context,
) -> Plan:
    """Plan in `scene`; execute in the true room of `ground_truth`, or in `scene` itself when there is none.

    `domain`: predicates and operators to plan with instead of the chain's (`read_given_domain`). `sequence`: the log
    that the scene was made of; the robot starts where its camera was."""
    reading = Reading(None if domain is None else read_given_domain(domain))
    robot = load_robot(parameters.robot)
    budgets = Budgets(
        parameters.base_samples,
        parameters.pair_samples,
        parameters.path_samples,
        parameters.path_searches,
        parameters.size_uncertainty,
    )
    with context.progress.step("load the scene"):
        model = WorldModel(scene.root, scene.graph, robot, parameters.clearance)
    try:
        beliefs = parse_priors(parameters.assume, model)
        graph = believe(model, scene.graph, beliefs)
        objects, initial = symbolic_state(model, graph, parameters.size_uncertainty)
        with context.progress.step("plan"):
            if has_words(parameters.goal):
                goal = named_goal(parameters.goal, objects, graph, language)
                parameters = parameters.model_copy(update={"goal": goal})
            cameras = None
            if sequence is not None and "pose" in sequence.info.streams:
                cameras = read_tum(sequence.path("trajectory.tum"))[1][:, :3, 3]
            scene_to_plan = Scene(model, graph, objects, initial, reading)
            state, planning = _find(scene_to_plan, budgets, parameters, context, cameras)
        problem = planning.problem or task_problem(objects, initial, frozenset())
        written = DOMAIN if reading.given is None else reading.given.domain
        context.output.joinpath("domain.pddl").write_text(domain_text(written), encoding="utf-8")
        context.output.joinpath("problem.pddl").write_text(problem_text(problem, written.name), encoding="utf-8")
        if planning.steps is not None and parameters.execute:
            order = Order(scene, ground_truth, graph, beliefs, planning.literals, reading, state, planning.steps)
            anew = partial(
                plan_and_refine,
                model,
                budgets=replace(budgets, size_uncertainty=0.0),
                random=context.random(REPLANNING),
                settings=_search_settings(parameters),
            )
            with context.progress.step("execute"):
                outcome = execute(
                    model,
                    order,
                    budgets,
                    lambda state, task: anew(state=state, task=task),
                    parameters,
                    context,
                    context.random(EXECUTION),
                )
        else:
            outcome = only_planned(model, graph, planning.steps)
        return _write(
            parameters,
            context,
            planning,
            outcome,
            graph,
            [*(belief.words for belief in beliefs), *planning.ungrounded],
            robot,
        )
    finally:
        model.close()


def _search_settings(parameters: PlanParameters) -> SearchSettings:
    return SearchSettings(
        parameters.heuristic, parameters.task_attempts, parameters.refinement_attempts, parameters.planner
    )


def _find(
    scene: Scene, budgets: Budgets, parameters: PlanParameters, context: Context, cameras: np.ndarray | None
) -> tuple[RobotState, Found]:
    """Return where the robot starts, and the plan of the first goal that has one (or the first goal, without)."""
    planning, model = Found(), scene.model
    carry = model.description.carry
    planning.ungrounded = _warn_of_ungrounded(scene, parameters, context)
    goals = [(scene.problem(literals), literals) for literals in _candidates(scene, parameters, planning.failures)]
    if not goals and not planning.failures:
        planning.failures.append(_nothing_to_do(model, scene.graph, scene.initial))
    if goals:
        planning.problem, planning.literals = goals[0]
    try:
        state = RobotState(_start(model, carry, parameters.stand, context.random(START), cameras), carry)
    except MotionFailed as failed:
        planning.failures.append(failed.failure)
        return RobotState(np.zeros(3), carry), planning
    for number, (problem, literals) in enumerate(goals):
        attempt = plan_and_refine(
            model,
            state,
            scene.reading.task(model, problem),
            budgets,
            context.random(SEARCH, number),
            _search_settings(parameters),
        )
        planning.failures += attempt.failures
        planning.learned += attempt.learned
        planning.tried += attempt.tried
        if attempt.steps is not None:
            planning.problem, planning.literals, planning.steps = problem, literals, attempt.steps
            break
    return state, planning


def _start(
    model: WorldModel,
    carry: np.ndarray,
    stand: tuple[float, ...],
    random: np.random.Generator,
    cameras: np.ndarray | None,
) -> np.ndarray:
    """Return where the robot starts (3,). Raises UsageError for no place, MotionFailed for none that is free."""
    if not stand and not model.description.drives:
        raise UsageError(f"the robot {model.description.name} does not drive", hint=f"say where it is: {STAND}")
    if not stand:
        return start_base(model, carry, random, cameras=cameras)
    base = np.array([*stand[:2], np.radians(stand[2])])
    collision = model.checker.check(np.concatenate([base, carry]))
    if collision is not None:
        raise end_in_collision("start", collision.part, collision.other, collision.depth)
    return base


def _warn_of_ungrounded(scene: Scene, parameters: PlanParameters, context: Context) -> tuple[str, ...]:
    """Return what can't be grounded of a given domain, and say it in one line."""
    domain = scene.reading.given
    if domain is None:
        return ()
    classes = {name: record.class_name for name, record in scene.model.records.items()}
    words = domain.ungrounded(scene.objects, classes)
    if words:
        context.logger.warning("%s: can't be grounded in this scene: %s", domain.source, "; ".join(words))
    return tuple(f"not grounded: {each}" for each in words)


def _candidates(scene: Scene, parameters: PlanParameters, failures: list[Failure]) -> list[tuple[str, ...]]:
    """Return the goals that may be tried, the preferred first; why a task has none goes to `failures`."""
    model, initial = scene.model, scene.initial
    if parameters.goal:
        return scene.reading.candidates(model, scene.graph, scene.objects, initial, parameters.goal)
    if not parameters.task:
        return default_goals(model, initial, model.description.opening + parameters.size_uncertainty)
    try:
        return task_goals(parameters.task, model, initial)
    except MotionFailed as failed:
        failures.append(failed.failure)
        return []


def _nothing_to_do(model: WorldModel, graph: ContactGraphFile, initial: frozenset[Atom]) -> Failure:
    """Say which part of the demo's goal is missing: an item behind a door, or a table."""
    inside = sum(atom[0] == "in" for atom in initial)
    tables = sum(record.class_name in TABLE_CLASSES for record in model.records.values())
    rigid = sorted(
        {
            link.source
            for link in graph.links
            if link.relation == "contains"
            and graph.node(link.source).node_type == "articulated"
            and link.source in model.records
            and not model.records[link.source].joints
        }
    )
    message = f"the scene has {inside} items behind doors and {tables} tables: the demo's goal needs one of each"
    if rigid:
        message += f"; {', '.join(rigid)} contain things but have no CAD model with moving parts"
    return Failure(
        kind="no_goal",
        message=message,
        objects=tuple(rigid),
        numbers={"items_inside": float(inside), "tables": float(tables)},
    )


def _write(
    parameters: PlanParameters,
    context: Context,
    planning: Found,
    outcome: Outcome,
    graph: ContactGraphFile,
    beliefs: list[str],
    robot: RobotDescription,
) -> Plan:
    steps = outcome.steps
    rows, ranges = planned_rows(steps or [], robot)
    actions = tuple(
        PlannedAction(
            name=step.name, arguments=step.arguments, start=start, end=end, base_pose=as_transform(_base(step))
        )
        for step, (start, end) in zip(steps or [], ranges, strict=True)
    )
    reached = bool(outcome.checks) and all(check.holds for check in outcome.checks)
    status: Status
    if steps is None:
        status = "infeasible"
    elif outcome.executed_in is None:
        status = "planned"
    else:
        status = "executed" if reached else "execution_failed"
    unmet = tuple(
        Failure(
            kind="condition_not_met", message=f"{check.condition} does not hold: {check.detail}", numbers=check.numbers
        )
        for check in outcome.checks
        if not check.holds
    )
    plan = PlanFile(
        goal=planning.literals,
        planned_in="reconstructed",
        executed_in=outcome.executed_in,
        actions=actions,
        failures=(*planning.failures, *outcome.failures, *unmet),
        checks=outcome.checks,
        margin=verdict_margin(outcome.checks),
        status=status,
        matches=outcome.matches,
        assumptions=(*beliefs, *outcome.assumptions),
        bumps=outcome.bumps,
        task=parameters.task or None,
        planner=parameters.planner,
        learned=(*planning.learned, *outcome.learned),
        tried=(*planning.tried, *outcome.tried),
        replanned=outcome.replanned,
        tree_differences=outcome.differences,
    )
    plan.write(context.output / "plan.json")
    (outcome.graph or graph).write(context.output / "graph.json")
    if outcome.graphs:
        (context.output / "graphs").mkdir()
    for number, after in outcome.graphs.items():
        after.write(context.output / "graphs" / f"{number}.json")
    write_trajectory(context.output / "trajectory.npz", rows | outcome.arrays)
    context.output.joinpath("plan.txt").write_text(plan_text(plan, steps or []), encoding="utf-8")
    ok = status in ("executed", "planned")
    summary = {
        "goal": " ".join(planning.literals),
        "status": status,
        "actions": len(actions),
        "checks": f"{sum(check.holds for check in outcome.checks)}/{len(outcome.checks)}",
        "failures": len(plan.failures),
    }
    if is_marginal(plan.margin):
        summary["verdict"] = "marginal"
    if not ok and plan.failures:
        last = plan.failures[-1]
        summary["reason"] = f"{last.kind}: {last.message}; `scenewright explain PLAN outcome` says all"
    return Plan(context.output, outcome="ok" if ok else status, summary=summary)


def _base(step: Step) -> np.ndarray:
    x, y, yaw = step.segments[-1].path[-1, :3]
    return transform_from_yaw(float(yaw), np.array([x, y, 0.0]))
