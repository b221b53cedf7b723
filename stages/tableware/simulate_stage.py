"""The step `tableware simulate`: one table, one policy or plan, one simulator."""

from __future__ import annotations

from collections.abc import Iterable

from scenewright.schemas.errors import BadInput
from scenewright.schemas.tableware_plan import TablewarePlan
from scenewright.schemas.tableware_scene import TablewareScene
from scenewright.schemas.tableware_trial import TablewareTrial, TablewareTrialFile, TrialCounts, TrialStep
from scenewright.stages.kit.stage import Context
from scenewright.stages.tableware.dishes_file import setting_of
from scenewright.stages.tableware.parameters import SimulateParameters
from scenewright.stages.tableware.plan_stage import panels
from scenewright.stages.tableware.planning.action import Action
from scenewright.stages.tableware.planning.choice import chances_of, make_policy
from scenewright.stages.tableware.planning.records import as_action, as_record
from scenewright.stages.tableware.planning.time_model import Chances, TimeModel
from scenewright.stages.tableware.sight import Eyes, named_as
from scenewright.stages.tableware.simulation.trial import Done, Trial, World, do_in, run_in, truth
from scenewright.stages.tableware.simulators import SIMULATORS
from scenewright.stages.tableware.table_pictures import draw_strip
from scenewright.stages.tableware.world.items import STANDARD, DishSizes, Table
from scenewright.stages.tableware.world.records import as_records, as_table
from scenewright.stages.tableware.world.shape_files import write_shapes


def run(
    scene: TablewareScene, plan: TablewarePlan | None, *, parameters: SimulateParameters, context: Context
) -> TablewareTrial:
    """Let a policy clear the table of a scene, or carry out a plan as it stands."""
    file = scene.info
    setting = setting_of(file.dishes)
    table = as_table(file.items, setting.sizes)
    simulator = SIMULATORS[parameters.simulator](parameters)
    eyes = Eyes(context.seed, file.light, file.colors, parameters.least_confidence, setting)
    policy = make_policy(parameters.policy, simulator.times, simulator.chances, context.seed, setting)
    planned = None if plan is None else planned_actions(plan, table, setting.sizes)
    done: list[Done] = []
    try:
        world = simulator.open(table, context.seed, setting)
        with context.progress.step("clear"):
            if planned is not None:
                trial = carry_out(world, planned, done)
            else:
                see = eyes if parameters.sight == "image" else truth
                trial = run_in(world, policy, see, done.append, simulator.again)
    finally:
        simulator.close()
    statement = _statement(trial, len(table.items))
    TablewareTrialFile(
        policy="plan" if planned is not None else parameters.policy,
        simulator=parameters.simulator,
        robot=simulator.recorded_robot,
        sight=parameters.sight,
        times=simulator.recorded_times,
        chances=simulator.recorded_chances,  # type: ignore[arg-type]
        counts=_counts(trial),
        steps=tuple(_steps(done, simulator.times, chances_of(parameters.chances))),
        images=eyes.images,
        statement=statement,
    ).write(context.output / "trial.json")
    context.output.joinpath("trial.txt").write_text(_text(done, statement), encoding="utf-8")
    write_shapes(context.output, setting.sizes)
    with context.progress.step("pictures"):
        draw_strip(panels(done, table), parameters.image_width).save(context.output / "keyframes.png")
        simulator.draw(done, context.output, parameters.image_width)
    summary: dict[str, object] = {
        "policy": "plan" if planned is not None else parameters.policy,
        "simulator": parameters.simulator,
        "seconds": round(trial.seconds, 1),
        "trips": trial.trips,
        "objects_per_trip": round(trial.objects_per_trip, 2),
    }
    if trial.failed:
        summary["reason"] = statement
    return TablewareTrial(root=context.output, outcome="not_cleared" if trial.failed else "ok", summary=summary)


def planned_actions(plan: TablewarePlan, table: Table, sizes: DishSizes = STANDARD) -> list[tuple[Action, Table]]:
    """Return the actions of a plan with the tables on which they were decided, named as the things that stand there in
    truth. Raises BadInput when the plan is about another table."""
    file = plan.info
    planned_table = as_table(file.items, sizes)
    renamed = named_as(planned_table, table)
    names = {item.name: true_item.name for item, true_item in zip(planned_table.items, renamed.items, strict=True)}
    if planned_table.items and all(name.startswith("stray_") for name in names.values()):
        raise BadInput(
            f"{plan.root}: none of its {len(planned_table.items)} items stands where one of the scene stands",
            hint="plan this scene, not another",
        )
    actions = []
    for step in file.steps:
        before = as_table(
            (
                item.model_copy(
                    update={
                        "name": names.get(item.name, item.name),
                        "on": None if item.on is None else names.get(item.on, item.on),
                    }
                )
                for item in step.before
            ),
            sizes,
        )
        actions.append((as_action(step.action).renamed(names), before))
    return actions


def carry_out(world: World, planned: Iterable[tuple[Action, Table]], done: list[Done]) -> Trial:
    """Carry out actions as they stand, whatever comes of them."""
    for action, seen_table in planned:
        done.append(do_in(world, action, seen_table))
    return world.trial


def _counts(trial: Trial) -> TrialCounts:
    return TrialCounts(
        seconds=trial.seconds,
        trips=trial.trips,
        moved=trial.moved,
        pulls=trial.pulls,
        stacks=trial.stacks,
        dropped=trial.dropped,
        left=trial.left,
        objects_per_trip=trial.objects_per_trip,
        failure=trial.failure,
    )


def _steps(done: list[Done], model: TimeModel, chances: Chances) -> Iterable[TrialStep]:
    for step in done:
        gone = tuple(name for name in step.before.by_name if name not in step.after.by_name)
        dropped = tuple(name for name in gone if name in step.dropped)
        yield TrialStep(
            action=as_record(step.action, step.before, model, chances),
            start=step.start,
            end=step.end,
            before=as_records(step.before),
            after=as_records(step.after),
            binned=tuple(name for name in gone if name not in dropped),
            dropped=dropped,
            troubles=step.troubles,
        )


def _statement(trial: Trial, items: int) -> str:
    text = f"{trial.moved} of {items} items to the bin in {trial.trips} trips and {trial.seconds:.1f} s"
    if trial.dropped:
        text += f", {trial.dropped} dropped"
    return text + (f", {trial.left} left on the table" if trial.left else "")


def _text(done: list[Done], statement: str) -> str:
    lines = [statement, ""]
    for step in done:
        lines.append(f"{step.start:7.1f} s  {step.action.words}")
        gone = [name for name in step.before.by_name if name not in step.after.by_name and name not in step.dropped]
        lines += [f"           binned: {', '.join(gone)}"] if gone else []
        lines += [f"           dropped: {', '.join(step.dropped)}"] if step.dropped else []
        lines += [f"           {trouble}" for trouble in step.troubles]
    return "\n".join(lines) + "\n"
