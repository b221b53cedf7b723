"""The step `plan`: symbols and geometry in the planned scene, execution in physics, checks, pictures."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from schemas.base import as_transform
from schemas.contact_graph import ContactGraphFile
from schemas.errors import UsageError
from schemas.ground_truth import GroundTruth
from schemas.interactive_scene import InteractiveScene
from schemas.plan import BodyMatch, Check, Failure, Plan, PlanFile, PlannedAction, TreeDifference, TriedPlan
from stages.kit.geometry.transforms import transform_from_yaw
from stages.kit.motion.failures import MotionFailed
from stages.kit.simulation.robot import Configuration
from stages.kit.simulation.robot_description import load_robot
from stages.kit.simulation.world import load_scene, read_scene_bodies
from stages.kit.stage import Context
from stages.kit.tasks.pddl import domain_text, problem_text
from stages.kit.tasks.strips import Atom
from stages.plan.assumptions import Belief, believe, match_beliefs, parse_priors
from stages.plan.checks import check_goal
from stages.plan.conduct import Conduct, Room, joint_pairs
from stages.plan.correspondence import match_bodies
from stages.plan.domain import DOMAIN
from stages.plan.execution import PhysicalRobot
from stages.plan.execution_log import write_execution
from stages.plan.goals import TABLE_CLASSES, default_goals
from stages.plan.parameters import PlanParameters
from stages.plan.pick_place import Budgets
from stages.plan.pictures import RoomPictures, picture_camera
from stages.plan.plan_text import plan_text
from stages.plan.refinement import Attempt, Step, plan_and_refine
from stages.plan.start_pose import start_base
from stages.plan.symbols import parse_goal, symbolic_state, task_problem
from stages.plan.tasks import task_goals
from stages.plan.trajectories import executed_rows, planned_rows, write_trajectory
from stages.plan.tree_state import (
    TreeState,
    after_step,
    graph_of_state,
    observed_state,
    start_state,
    tree_differences,
)
from stages.plan.world_model import RobotState, WorldModel, body_planes

Status = Literal["executed", "planned", "infeasible", "execution_failed"]
RECORD_RATE = 10.0
SETTLE_SECONDS = 1.0
START, SEARCH, EXECUTION = 1, 2, 3
"""Random streams."""
LOOK = (
    "before each action the robot saw pose, joint values and shape of the bodies that the action names, as they are in "
    "the room (stands for a wrist camera's look); everything else it knew from the planned scene"
)
PROPRIOCEPTION = "the pose of a held item in the hand was read from the simulation"
GRIP = "items are held by friction of the two fingers alone; no constraint is added"


@dataclass(frozen=True)
class Outcome:
    """What goes into plan.json beyond the plan itself."""

    executed_in: str | None
    carried_out: bool
    checks: tuple[Check, ...]
    matches: tuple[BodyMatch, ...]
    assumptions: tuple[str, ...]
    failures: tuple[Failure, ...]
    bumps: dict[str, float]
    graphs: dict[int, ContactGraphFile] = field(default_factory=dict)
    """Index of an action -> the graph after it."""
    differences: tuple[TreeDifference, ...] = ()


@dataclass(frozen=True)
class Search:
    """How the plan was found, or not: the task plans that geometry tried, and what their failures taught."""

    tried: tuple[TriedPlan, ...]
    learned: tuple[str, ...]


@dataclass(frozen=True)
class Found:
    """What planning found, beyond the steps."""

    literals: tuple[str, ...]
    steps: list[Step] | None
    search: Search
    assumptions: tuple[str, ...]


def run(
    scene: InteractiveScene, ground_truth: GroundTruth | None, *, parameters: PlanParameters, context: Context
) -> Plan:
    """Plan in `scene`; execute in the true room of `ground_truth`, or in `scene` itself when there is none."""
    if parameters.goal and parameters.task:
        raise UsageError("--goal and --task cannot be given together", hint="leave one of them out")
    robot = load_robot(parameters.robot)
    budgets = Budgets(
        parameters.base_samples, parameters.pair_samples, parameters.path_samples, parameters.path_searches,
        parameters.size_uncertainty,
    )  # fmt: skip
    graph = scene.graph
    with context.progress.step("load the scene"):
        model = WorldModel(scene.root, graph, robot, parameters.clearance)
    try:
        beliefs = parse_priors(parameters.assume, model)
        graph = believe(model, graph, beliefs)
        objects, initial = symbolic_state(model, graph, parameters.size_uncertainty)
        failures: list[Failure] = []
        goals = [parse_goal(literals, objects) for literals in _candidates(model, initial, parameters, failures)]
        try:
            base = start_base(model, robot.carry, context.random(START))
        except MotionFailed as failed:
            base, goals = np.zeros(3), goals[:1]
            failures.append(failed.failure)
        state = RobotState(base, robot.carry)
        with context.progress.step("plan"):
            goal, literals, attempt, search = _first_feasible(
                model, state, goals if not failures else [], objects, initial, budgets, parameters, context, failures
            )
        if not goals and not failures:
            failures.append(_nothing_to_do(model, graph, initial))
        problem = task_problem(objects, initial, goal)
        context.output.joinpath("domain.pddl").write_text(domain_text(DOMAIN), encoding="utf-8")
        context.output.joinpath("problem.pddl").write_text(problem_text(problem, DOMAIN.name), encoding="utf-8")
        steps = attempt.steps if attempt is not None else None
        rows, ranges = planned_rows(steps or [], robot)
        believed = start_state(model)
        outcome = _only_planned(model, graph, steps or [], believed)
        arrays = dict(rows)
        updated = list(outcome.graphs.values())[-1] if outcome.graphs else graph
        if steps is not None and parameters.execute:
            with context.progress.step("execute"):
                outcome, snapshots, updated = _execute(
                    model,
                    scene,
                    ground_truth,
                    graph,
                    state,
                    steps,
                    literals,
                    budgets,
                    parameters,
                    context,
                    failures,
                    beliefs,
                )
            arrays |= snapshots
        found = Found(literals, steps, search, tuple(belief.words for belief in beliefs))
        return _write(parameters, context, found, ranges, failures, outcome, arrays, updated)
    finally:
        model.close()


def _candidates(
    model: WorldModel, initial: frozenset[Atom], parameters: PlanParameters, failures: list[Failure]
) -> list[tuple[str, ...]]:
    """Return the goals that may be tried, the preferred first; why a task has none goes to `failures`."""
    if parameters.goal:
        return [parameters.goal]
    if not parameters.task:
        return default_goals(model, initial, model.description.opening + parameters.size_uncertainty)
    try:
        return task_goals(parameters.task, model, initial)
    except MotionFailed as failed:
        failures.append(failed.failure)
        return []


def _first_feasible(
    model: WorldModel, state: RobotState, goals: list[tuple[frozenset[Atom], tuple[str, ...]]], objects: dict[str, str],
    initial: frozenset[Atom], budgets: Budgets, parameters: PlanParameters, context: Context, failures: list[Failure],
) -> tuple[frozenset[Atom], tuple[str, ...], Attempt | None, Search]:  # fmt: skip
    """Try the goals in order; return the first with a plan, or the first of all without one, and the search.

    Failures are collected.
    """
    learned: list[str] = []
    tried: list[TriedPlan] = []
    for number, (goal, literals) in enumerate(goals):
        attempt = plan_and_refine(
            model, state, DOMAIN, task_problem(objects, initial, goal), budgets, context.random(SEARCH, number),
            heuristic=parameters.heuristic, task_attempts=parameters.task_attempts,
            refinement_attempts=parameters.refinement_attempts, planner=parameters.planner,
        )  # fmt: skip
        failures += attempt.failures
        learned += attempt.learned
        tried += attempt.tried
        if attempt.steps is not None:
            return goal, literals, attempt, Search(tuple(tried), tuple(learned))
    search = Search(tuple(tried), tuple(learned))
    return (*goals[0], None, search) if goals else (frozenset(), (), None, search)


def _nothing_to_do(model: WorldModel, graph: ContactGraphFile, initial: frozenset[Atom]) -> Failure:
    """Say which part of the demo's goal is missing: an item behind a door, or a table."""
    inside = sum(atom[0] == "in" for atom in initial)
    tables = sum(record.class_name in TABLE_CLASSES for record in model.records.values())
    rigid = sorted(
        {link.source for link in graph.links
         if link.relation == "contains" and graph.node(link.source).node_type == "articulated"
         and link.source in model.records and not model.records[link.source].joints}
    )  # fmt: skip
    message = f"the scene has {inside} items behind doors and {tables} tables: the demo's goal needs one of each"
    if rigid:
        message += f"; {', '.join(rigid)} contain things but have no CAD model with moving parts"
    return Failure(
        kind="no_goal", message=message, objects=tuple(rigid),
        numbers={"items_inside": float(inside), "tables": float(tables)},
    )  # fmt: skip


def _execute(
    model: WorldModel, scene: InteractiveScene, ground_truth: GroundTruth | None, graph: ContactGraphFile,
    state: RobotState, steps: list[Step], literals: tuple[str, ...], budgets: Budgets, parameters: PlanParameters,
    context: Context, failures: list[Failure], beliefs: list[Belief],
) -> tuple[Outcome, dict[str, np.ndarray], ContactGraphFile]:  # fmt: skip
    """Carry out the steps in the room, write pictures and log, and return what came of it."""
    root = scene.root if ground_truth is None else ground_truth.path("room")
    nodes = {node.id: node for node in (graph if ground_truth is None else ground_truth.graph).nodes}
    bodies = read_scene_bodies(root)
    records = {name: record for name, (record, _) in bodies.items()}
    texts = {name: text for name, (_, text) in bodies.items()}
    planes = {}
    for name in records:
        known = nodes[name].planes if name in nodes else ()
        flat = any(plane.horizontal and len(plane.corners) == 4 for plane in known)
        planes[name] = known if flat else known + body_planes(records[name], texts[name])
    planned = dict(model.records)
    matches = match_beliefs(beliefs, match_bodies(planned, records, parameters.match_radius), records)
    believed = start_state(model)
    joint_names = joint_pairs(planned, records, matches)
    with load_scene(root) as world:
        start = Configuration(state.base, state.arm, model.description.opening)
        physical = PhysicalRobot(world, model.description, start, RECORD_RATE)
        free = _starts_free(physical, failures)
        physical.wait(SETTLE_SECONDS)
        observed = {-1: observed_state(world, matches, joint_names, None)}
        physical.recording.keyframe(-1, "start")
        conduct = Conduct(
            model, Room(records, texts, planes), physical, matches, joint_names, replace(budgets, size_uncertainty=0.0),
            context.random(EXECUTION), parameters.relocalize, parameters.execution_attempts,
            observe=lambda number: observed.update({
                number: observed_state(world, matches, joint_names, physical.held)
            }),
        )  # fmt: skip
        carried_out = free and conduct.run(state, steps)
        world.wake()
        physical.wait(SETTLE_SECONDS)
        physical.recording.keyframe(len(steps) - 1, "end")
        checks = check_goal(world, literals, matches, joint_names, physical.held)
        final = observed_state(world, matches, joint_names, physical.held)
        with context.progress.step("pictures"):
            _draw(RoomPictures(world, records, texts, model.description), physical, parameters, context)
    graphs = {
        number: graph_of_state(graph, observed[-1], state, believed, model)
        for number, state in observed.items() if number >= 0
    }  # fmt: skip
    updated = graph_of_state(graph, observed[-1], final, believed, model)
    differences: list[TreeDifference] = []
    expected = replace(believed, parents={**believed.parents, **observed[-1].parents})
    for number, step in enumerate(steps):
        expected = after_step(expected, step)
        if number in observed:
            differences += tree_differences(number, expected, observed[number], model)
    named = {name for step in steps for name in step.arguments} | {
        name for name in planned for step in steps for argument in step.arguments if argument.startswith(f"{name}__")
    }
    assumptions = (LOOK, PROPRIOCEPTION, GRIP) if parameters.relocalize else ("the planned motion was replayed", GRIP)
    outcome = Outcome(
        "reconstructed" if ground_truth is None else "ground_truth", carried_out, checks,
        tuple(match for name, match in matches.items() if name in named), assumptions, tuple(conduct.failures),
        {name: round(force, 3) for name, force in sorted(physical.bumps.items())}, graphs, tuple(differences),
    )  # fmt: skip
    return outcome, executed_rows(physical.recording.snapshots), updated


def _starts_free(physical: PhysicalRobot, failures: list[Failure]) -> bool:
    try:
        physical.check_start()
    except MotionFailed as failed:
        failures.append(failed.failure)
        return False
    return True


def _only_planned(
    model: WorldModel, graph: ContactGraphFile, steps: list[Step], believed: TreeState
) -> Outcome:  # fmt: skip
    """Return what a plan that is not executed leaves: the graphs as planned."""
    graphs, state = {}, believed
    for number, step in enumerate(steps):
        state = after_step(state, step)
        if step.manipulation is not None:
            graphs[number] = graph_of_state(graph, believed, state, believed, model)
    return Outcome(None, False, (), (), (), (), {}, graphs)


def _draw(pictures: RoomPictures, physical: PhysicalRobot, parameters: PlanParameters, context: Context) -> None:
    import cv2

    recording = physical.recording
    folder = context.output / "keyframes"
    folder.mkdir()
    camera = picture_camera(parameters.image_width)
    for number, (index, label) in enumerate(context.progress.track(recording.keyframes, description="key frames")):
        image = pictures.near(recording.snapshots[index], camera)
        cv2.imwrite(str(folder / f"{number:02d}_{label}.png"), cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    small = picture_camera(min(400, parameters.image_width), 0.8)
    images: dict[int, np.ndarray] = {}
    if parameters.video_rate > 0:
        every = max(1, round(RECORD_RATE / parameters.video_rate))
        wanted = list(range(0, len(recording.snapshots), every))
        for index in context.progress.track(wanted, description="video"):
            images[index] = pictures.overview(recording.snapshots[index], small)
    write_execution(
        context.output / "execution.mcap", recording.snapshots, images, small, pictures.overview_pose(small)
    )


def _write(
    parameters: PlanParameters, context: Context, found: Found, ranges: list[tuple[int, int]], failures: list[Failure],
    outcome: Outcome, arrays: dict[str, np.ndarray], graph: ContactGraphFile,
) -> Plan:  # fmt: skip
    literals, steps = found.literals, found.steps
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
        Failure(kind="condition_not_met", message=f"{check.condition} does not hold: {check.detail}",
                numbers=check.numbers)
        for check in outcome.checks if not check.holds
    )  # fmt: skip
    plan = PlanFile(
        goal=literals, planned_in="reconstructed", executed_in=outcome.executed_in, actions=actions,
        failures=(*failures, *outcome.failures, *unmet), checks=outcome.checks, status=status,
        matches=outcome.matches, assumptions=(*found.assumptions, *outcome.assumptions), bumps=outcome.bumps,
        task=parameters.task or None, planner=parameters.planner, learned=found.search.learned,
        tried=found.search.tried, tree_differences=outcome.differences,
    )  # fmt: skip
    plan.write(context.output / "plan.json")
    graph.write(context.output / "graph.json")
    if outcome.graphs:
        (context.output / "graphs").mkdir()
    for number, after in outcome.graphs.items():
        after.write(context.output / "graphs" / f"{number}.json")
    write_trajectory(context.output / "trajectory.npz", arrays)
    context.output.joinpath("plan.txt").write_text(plan_text(plan, steps or []), encoding="utf-8")
    ok = status in ("executed", "planned")
    summary = {
        "goal": " ".join(literals), "status": status, "actions": len(actions),
        "checks": f"{sum(check.holds for check in outcome.checks)}/{len(outcome.checks)}",
        "failures": len(plan.failures),
    }  # fmt: skip
    return Plan(context.output, outcome="ok" if ok else status, summary=summary)


def _base(step: Step) -> np.ndarray:
    x, y, yaw = step.segments[-1].path[-1, :3]
    return transform_from_yaw(float(yaw), np.array([x, y, 0.0]))
