"""The step `tableware plan`: from what is seen of a table to actions, what they should take, and what was refused."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image
from scenewright.schemas.tableware_detections import TablewareDetections
from scenewright.schemas.tableware_plan import TablewarePlan, TablewarePlanFile, TablewareStep
from scenewright.schemas.tableware_scene import TablewareScene
from scenewright.stages.kit.stage import Context
from scenewright.stages.tableware.dishes_file import estimated_setting, file_of, setting_of
from scenewright.stages.tableware.parameters import PlanParameters
from scenewright.stages.tableware.planning.choice import as_times, chances_of, declared_policy, make_policy, time_model
from scenewright.stages.tableware.planning.reasons import impossible_pairs
from scenewright.stages.tableware.planning.records import as_record
from scenewright.stages.tableware.planning.refusals import Accepted, accept, statement
from scenewright.stages.tableware.planning.rules import Rules
from scenewright.stages.tableware.planning.time_model import EXACT, Chances, TimeModel
from scenewright.stages.tableware.ros2_plan import write_plan_bag
from scenewright.stages.tableware.scene_files import read_image
from scenewright.stages.tableware.sight import look, setting_seen, understood
from scenewright.stages.tableware.simulation.fast import FastWorld, run_trial
from scenewright.stages.tableware.simulation.trial import Done, Trial, run_in
from scenewright.stages.tableware.table_pictures import Panel, draw_strip
from scenewright.stages.tableware.vision.detections_file import from_file
from scenewright.stages.tableware.vision.overlay import draw_sight
from scenewright.stages.tableware.vision.seeing import Sizes
from scenewright.stages.tableware.world.items import Table
from scenewright.stages.tableware.world.records import as_records, as_table
from scenewright.stages.tableware.world.setting import Setting

ESTIMATED = (
    "sizes are estimated: nothing is stacked, side by side go only kinds whose dishes measure alike, and forks and "
    "spoons were not looked for"
)
OTHER_SETTING = "which piles hold side by side was measured with the standard dishes and hand, not with these"
"""Said of every plan that goes by other sizes."""
FROM_THE_SIDE = "seen from the side, where kinds are sometimes wrong: nothing is stacked"


def run(
    detections: TablewareDetections | None,
    scene: TablewareScene | None,
    *,
    parameters: PlanParameters,
    context: Context,
) -> TablewarePlan:
    """Plan from what was detected, from a scene's image, or from its ground truth."""
    model, chances = time_model(parameters), chances_of(parameters.chances)
    with context.progress.step("see"):
        table_seen = _understand_table(detections, scene, parameters, context)
    accepted, notes, setting = table_seen.accepted, table_seen.notes, table_seen.setting
    table = accepted.table
    with context.progress.step("plan"):
        done: list[Done] = []
        policy = make_policy(parameters.policy, model, chances, context.seed, setting)
        nominal = run_in(FastWorld(table, model, EXACT, context.seed, setting), policy, hear=done.append)
        expected = _expect(table, setting, model, chances, parameters, context.seed)
    file = TablewarePlanFile(
        policy=parameters.policy,
        source="detections" if detections is not None else parameters.source,
        times=as_times(model),
        chances=parameters.chances,
        items=as_records(table),
        dishes=file_of(setting),
        sizes=table_seen.sizes,
        steps=tuple(
            TablewareStep(action=as_record(step.action, step.before, model, chances), before=as_records(step.before))
            for step in done
        ),
        seconds=nominal.seconds,
        trips=nominal.trips,
        expected_seconds=expected.seconds,
        expected_trips=expected.trips,
        expected_objects_per_trip=expected.objects_per_trip,
        risk=expected.risk,
        draws=parameters.draws,
        impossible=impossible_pairs(table, declared_policy(parameters.policy).rules_in(setting)),
        refused=accepted.refused,
        notes=notes,
        statement=statement(accepted, notes),
    )
    file.write(context.output / "plan.json")
    write_plan_bag(context.output / "plan.mcap", file)
    context.output.joinpath("plan.txt").write_text(plan_text(file, done), encoding="utf-8")
    with context.progress.step("pictures"):
        draw_strip(panels(done, table), parameters.image_width).save(context.output / "strip.png")
    summary = {
        "policy": file.policy,
        "items": len(table.items),
        "trips": file.trips,
        "seconds": round(file.seconds, 1),
        "expected_seconds": round(file.expected_seconds, 1),
        "refused": len(file.refused),
    }
    outcome = "partial" if file.refused or notes else "ok" if table.items else "empty"
    if outcome != "ok":
        summary["reason"] = file.statement
    return TablewarePlan(root=context.output, outcome=outcome, summary=summary)


@dataclass(frozen=True)
class Understood:
    """What is planned for, what vision did not handle, and with which sizes and hand."""

    accepted: Accepted
    notes: tuple[str, ...]
    setting: Setting
    sizes: Sizes = "known"


def _understand_table(
    detections: TablewareDetections | None, scene: TablewareScene | None, parameters: PlanParameters, context: Context
) -> Understood:
    """Return what is planned for."""
    least = parameters.least_confidence
    if detections is not None:
        payload = detections.info
        setting, notes, detected = setting_of(payload.dishes), payload.notes, from_file(payload)
        if payload.sizes == "estimated":
            setting = estimated_setting(detected, setting.gripper)
            notes = (*notes, ESTIMATED)
        elif setting != Setting():
            notes = (*notes, OTHER_SETTING)
        seen_so = setting_seen(detected, setting)
        if seen_so != setting:
            notes = (*notes, FROM_THE_SIDE)
        return Understood(understood(detected, least, seen_so), notes, seen_so, payload.sizes)
    assert scene is not None  # the declaration asks for one of the two
    setting = setting_of(scene.info.dishes)
    notes = () if setting == Setting() else (OTHER_SETTING,)
    if parameters.source == "truth":
        table = as_table(scene.info.items, setting.sizes)
        return Understood(accept(table, {}, (), least, Rules(setting)), notes, setting)
    color, depth, view = read_image(scene)
    sighting = look(color, depth, view, least, setting)
    picture = Image.fromarray(draw_sight(color, sighting.sight))
    picture.thumbnail((parameters.image_width, parameters.image_width))
    picture.save(context.output / "detections.png")
    return Understood(sighting.accepted, (*sighting.sight.notes, *notes), setting)


@dataclass(frozen=True)
class Expected:
    """Means over draws of what chance decides."""

    seconds: float
    trips: float
    objects_per_trip: float
    risk: float


def _expect(
    table: Table, setting: Setting, model: TimeModel, chances: Chances, parameters: PlanParameters, seed: int
) -> Expected:
    """Return what a policy comes to on the table as it was seen."""
    if not table.items:
        return Expected(0.0, 0.0, 0.0, 0.0)
    declared = declared_policy(parameters.policy)
    policy = declared.make(model, chances, seed, setting)
    done: list[Trial] = []
    for draw in range(1 if chances.sure and not chances.noise else parameters.draws):
        if declared.draws:
            policy = declared.make(model, chances, 1000 * seed + draw, setting)
        done.append(run_trial(table, policy, model, chances, (seed, draw), setting))
    return Expected(
        float(np.mean([trial.seconds for trial in done])),
        float(np.mean([trial.trips for trial in done])),
        float(np.mean([trial.objects_per_trip for trial in done])),
        float(np.mean([trial.failed for trial in done])),
    )


def panels(done: list[Done], table: Table) -> list[Panel]:
    """Return the table before each action, and at the end."""
    rows: list[Panel] = [
        (step.before, step.action, f"{number}. {step.action.words} ({step.end - step.start:.1f} s)")
        for number, step in enumerate(done, start=1)
    ]
    last = done[-1] if done else None
    end = f"after {last.end:.0f} s" if last is not None else "nothing to clear"
    return [*rows, (last.after if last is not None else table, None, end)]


def plan_text(file: TablewarePlanFile, done: list[Done]) -> str:
    """Return a plan as people read it."""
    lines = [file.statement, f"policy {file.policy}, items from {file.source}", ""]
    lines += [
        f"{number:3}. {step.action.words}, {step.end - step.start:.1f} s" for number, step in enumerate(done, start=1)
    ]
    lines += [
        "",
        f"{file.trips} trips and {file.seconds:.1f} s when nothing slips; over {file.draws} draws "
        f"{file.expected_trips:.1f} trips and {file.expected_seconds:.1f} s, {file.expected_objects_per_trip:.2f} "
        f"objects a trip, {100 * file.risk:.0f} % with something dropped or left",
    ]
    if file.impossible:
        lines += ["", "not possible as things stand:"]
        lines += [f"  {pair.primitive.replace('_', ' ')}: {pair.message}" for pair in file.impossible]
    return "\n".join(lines) + "\n"
