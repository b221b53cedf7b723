"""The step `tableware simulate`: one table, one policy or plan, one simulator."""

from __future__ import annotations

import importlib
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from schemas.errors import BadInput, MissingDependency
from schemas.tableware_plan import TablewarePlan
from schemas.tableware_scene import TablewareScene
from schemas.tableware_trial import TablewareTrial, TablewareTrialFile, TrialCounts, TrialStep
from stages.kit.stage import Context
from stages.tableware.parameters import SimulateParameters
from stages.tableware.plan_stage import panels
from stages.tableware.planning.actions import Action, Grasp, Pull, PullGrasp, Stack, StackGrasp
from stages.tableware.planning.choice import as_times, chances_of, make_policy, time_model
from stages.tableware.planning.records import as_action, as_record
from stages.tableware.planning.time_model import Chances, TimeModel
from stages.tableware.sight import Eyes, named_as
from stages.tableware.simulation.arm_times import arm_times
from stages.tableware.simulation.fast import Done, FastWorld, Trial, World, do_in, run_in, truth
from stages.tableware.table_pictures import draw_strip, words_of, write_animation
from stages.tableware.world.items import Table
from stages.tableware.world.records import as_records, as_table
from stages.tableware.world.shape_files import write_shapes

ANIMATION_WIDTH = 560
SIMULATION = "stages.tableware.simulation"
"""Its modules of physics are loaded only when they are asked for."""


def run(
    scene: TablewareScene, plan: TablewarePlan | None, *, parameters: SimulateParameters, context: Context
) -> TablewareTrial:
    """Let a policy clear the table of a scene, or carry out a plan as it stands."""
    file = scene.info
    table = as_table(file.items)
    model, chances = times_of(parameters), chances_of(parameters.chances)
    eyes = Eyes(context.seed, file.light, file.colors, parameters.least_confidence)
    in_physics = parameters.simulator == "physics"
    policy = make_policy(parameters.policy, model, replace(chances, spills=chances.spills or in_physics), context.seed)
    planned = None if plan is None else planned_actions(plan, table)
    done: list[Done] = []
    recording = physics_part("recording").Recording() if in_physics else None
    world = open_world(parameters.simulator, table, model, chances, context.seed, recording)
    try:
        with context.progress.step("clear"):
            if planned is not None:
                trial = carry_out(world, planned, done)
            else:
                again = physics_part("physics_trial").alone if in_physics else None
                trial = run_in(world, policy, eyes if parameters.sight == "image" else truth, done.append, again)
    finally:
        close = getattr(world, "close", None)
        if close is not None:
            close()
    counts = _counts(trial)
    said = _statement(trial, len(table.items))
    TablewareTrialFile(
        policy="plan" if planned is not None else parameters.policy,
        simulator=parameters.simulator,
        sight=parameters.sight,
        times=as_times(model) if parameters.simulator == "fast" else None,
        chances=parameters.chances if parameters.simulator == "fast" else "contact",
        counts=counts,
        steps=tuple(_steps(done, model, chances)),
        images=eyes.images,
        statement=said,
    ).write(context.output / "trial.json")
    context.output.joinpath("trial.txt").write_text(_text(done, said), encoding="utf-8")
    write_shapes(context.output)
    with context.progress.step("pictures"):
        draw_strip(panels(done, table), parameters.image_width).save(context.output / "keyframes.png")
        width = min(ANIMATION_WIDTH, parameters.image_width)
        if recording is not None:
            _draw_physics(recording.arrays(), done, context.output, parameters.image_width, width)
        else:
            moving = [(one.action, one.before, one.after, f"{one.start:.0f} s: {words_of(one.action)}") for one in done]
            write_animation(context.output / "clearing.gif", moving, width)
    summary: dict[str, object] = {
        "policy": "plan" if planned is not None else parameters.policy,
        "simulator": parameters.simulator,
        "seconds": round(trial.seconds, 1),
        "trips": trial.trips,
        "objects_per_trip": round(trial.objects_per_trip, 2),
    }
    if trial.failed:
        summary["reason"] = said
    return TablewareTrial(root=context.output, outcome="not_cleared" if trial.failed else "ok", summary=summary)


def times_of(parameters: SimulateParameters) -> TimeModel:
    """Return the times by which the policy plans: the arm's own in physics; what is given explicitly in their place."""
    if parameters.simulator == "fast":
        return time_model(parameters)
    arm = arm_times(parameters.delay)
    given = {"trip": parameters.trip_seconds, "stack": parameters.stack_seconds, "pull": parameters.pull_seconds}
    return replace(arm, **{name: value for name, value in given.items() if value is not None})


def _draw_physics(
    frames: dict[str, np.ndarray], done: list[Done], folder: Path, strip_width: int, animation_width: int
) -> None:
    """Write physics.png and clearing.gif from what was recorded."""
    pictures = physics_part("physics_pictures")
    words = [
        next((words_of(one.action) for one in done if one.start <= seconds <= one.end + 1e-6), "")
        for seconds in frames["seconds"]
    ]
    pictures.draw_physics_strip(frames, words, strip_width).save(folder / "physics.png")
    pictures.write_physics_animation(folder / "clearing.gif", frames, words, animation_width)


def physics_part(name: str) -> Any:
    """Return a module of the simulation that needs a physics engine. Raises MissingDependency where there is none."""
    try:
        return importlib.import_module(f"{SIMULATION}.{name}")
    except ImportError as error:
        raise MissingDependency(f"tableware has no physics here: {error}", hint="--simulator fast") from None


def open_world(
    simulator: str, table: Table, model: TimeModel, chances: Chances, seed: int, recording: Any = None
) -> World:
    """Return a world with a table in it; physics tell `recording` of key frames. Raises MissingDependency where there
    is no physics."""
    if simulator == "fast":
        return FastWorld(table, model, chances, seed)
    world: World = physics_part("physics").PhysicsTable(table, record=recording)
    return world


def planned_actions(plan: TablewarePlan, table: Table) -> list[tuple[Action, Table]]:
    """Return the actions of a plan with the tables on which they were decided, named as the things that stand there in
    truth. Raises BadInput when the plan is about another table."""
    file = plan.info
    seen = as_table(file.items)
    renamed = named_as(seen, table)
    names = {one.name: other.name for one, other in zip(seen.items, renamed.items, strict=True)}
    if seen.items and all(name.startswith("stray_") for name in names.values()):
        raise BadInput(
            f"{plan.root}: none of its {len(seen.items)} items stands where one of the scene stands",
            hint="plan this scene, not another",
        )
    actions = []
    for step in file.steps:
        before = as_table(one.model_copy(update={"name": names.get(one.name, one.name),
                                                 "on": None if one.on is None else names.get(one.on, one.on)})
                          for one in step.before)  # fmt: skip
        actions.append((renamed_action(as_action(step.action), names), before))
    return actions


def renamed_action(action: Action, names: dict[str, str]) -> Action:
    """Return an action with its things called by other names; those that have none keep theirs."""

    def name(old: str) -> str:
        return names.get(old, old)

    if isinstance(action, PullGrasp):
        return PullGrasp(_renamed_pull(action.u_P, names), _renamed_grasp(action.u_G, names))
    if isinstance(action, StackGrasp):
        put = action.u_S
        return StackGrasp(
            Stack(_renamed_grasp(put.u_G, names), name(put.onto), put.p_L, put.theta_L),
            _renamed_grasp(action.u_G, names),
        )
    if isinstance(action, Pull):
        return _renamed_pull(action, names)
    if isinstance(action, Stack):
        return Stack(_renamed_grasp(action.u_G, names), name(action.onto), action.p_L, action.theta_L)
    return _renamed_grasp(action, names)


def _renamed_grasp(action: Grasp, names: dict[str, str]) -> Grasp:
    return Grasp(tuple(names.get(item, item) for item in action.items), action.p_G, action.theta_G)


def _renamed_pull(action: Pull, names: dict[str, str]) -> Pull:
    item, target = names.get(action.item, action.item), names.get(action.target, action.target)
    return Pull(item, target, action.p_S, action.theta_S, action.p_E, action.theta_E)


def carry_out(world: World, planned: Iterable[tuple[Action, Table]], done: list[Done]) -> Trial:
    """Carry out actions as they stand, whatever comes of them."""
    for action, seen in planned:
        done.append(do_in(world, action, seen))
    return world.trial


def _counts(trial: Trial) -> TrialCounts:
    return TrialCounts(
        seconds=trial.seconds, trips=trial.trips, moved=trial.moved, pulls=trial.pulls, stacks=trial.stacks,
        dropped=trial.dropped, left=trial.left, objects_per_trip=trial.objects_per_trip, failure=trial.failure,
    )  # fmt: skip


def _steps(done: list[Done], model: TimeModel, chances: Chances) -> Iterable[TrialStep]:
    for one in done:
        gone = tuple(name for name in one.before.by_name if name not in one.after.by_name)
        dropped = tuple(name for name in gone if name in one.dropped)
        yield TrialStep(
            action=as_record(one.action, one.before, model, chances),
            start=one.start,
            end=one.end,
            before=as_records(one.before),
            after=as_records(one.after),
            binned=tuple(name for name in gone if name not in dropped),
            dropped=dropped,
            troubles=one.troubles,
        )


def _statement(trial: Trial, items: int) -> str:
    text = f"{trial.moved} of {items} items to the bin in {trial.trips} trips and {trial.seconds:.1f} s"
    if trial.dropped:
        text += f", {trial.dropped} dropped"
    return text + (f", {trial.left} left on the table" if trial.left else "")


def _text(done: list[Done], statement: str) -> str:
    lines = [statement, ""]
    for one in done:
        lines.append(f"{one.start:7.1f} s  {words_of(one.action)}")
        gone = [name for name in one.before.by_name if name not in one.after.by_name and name not in one.dropped]
        lines += [f"           binned: {', '.join(gone)}"] if gone else []
        lines += [f"           dropped: {', '.join(one.dropped)}"] if one.dropped else []
        lines += [f"           {trouble}" for trouble in one.troubles]
    return "\n".join(lines) + "\n"
