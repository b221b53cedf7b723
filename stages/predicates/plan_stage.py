"""The step `predicates plan`: a goal in words, planned for with what was learned and tried in the kitchen."""

from __future__ import annotations

from logging import INFO, WARNING
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.schemas.kitchen_plan import KitchenPlan, KitchenPlanFile, KitchenStep
from scenewright.schemas.learned_domain import LearnedDomain
from scenewright.stages.kit.stage import Context
from scenewright.stages.predicates.execution import PLANNERS, Attempt, Live, attempt, why_not
from scenewright.stages.predicates.learning.memory import Memory
from scenewright.stages.predicates.learning.records import memory_of
from scenewright.stages.predicates.parameters import PlanParameters
from scenewright.stages.predicates.pictures import animate, draw_kitchen
from scenewright.stages.predicates.task_folder import read_task_sets
from scenewright.stages.predicates.tasks import Task, open_kitchen, tasks_of


def run(learned: LearnedDomain, tasks: Path | None, *, parameters: PlanParameters, context: Context) -> KitchenPlan:
    """Plan and try: a goal in words, else what the task's own sentence says, else what the task wants besides."""
    name = learned.info.domain
    if learned.info.setting != "kitchen":
        raise BadInput(
            f"{learned.root}: was learned in rooms", hint="scenewright plan --domain plans in scenes with it"
        )
    memory = memory_of(learned.info, str(learned.root))
    task = _task(name, tasks, parameters, context.seed)
    sentence = parameters.goal or task.said or task.sentence
    goal, missing = memory.wanted(sentence, task.objects)
    unread = ""
    if missing and not parameters.goal and sentence != task.sentence:
        unread = missing
        context.logger.warning("%s: %s; planned for %s", sentence, unread, task.sentence)
        goal, missing = memory.wanted(task.sentence, task.objects)
    kitchen = open_kitchen(task)
    before = kitchen.polygons()
    kitchen.frames = [before]
    result = Attempt()
    if not missing:
        domain = memory.domain(name)
        planner = PLANNERS[parameters.planner]
        result = attempt(task, name, domain, memory.see, goal, replan=True, world=Live(kitchen), planner=planner)
        missing = missing_of(memory, result)
    reached = not missing and goal <= memory.see(kitchen.state())
    if not parameters.goal:
        reached = reached and result.success
    statement = _statement(task, sentence, result, reached, missing)
    KitchenPlanFile(
        domain=name,
        goal=sentence,
        wanted=tuple(sorted(goal)),
        success=reached,
        steps=tuple(KitchenStep(action=action, failed=reason) for action, reason in result.steps),
        missing=missing,
        unread=unread,
        statement=statement,
    ).write(context.output / "plan.json")
    width = parameters.image_width
    after = kitchen.polygons()
    sheet = draw_kitchen(before, width, "before")
    picture = sheet.resize((sheet.width, 2 * sheet.height))
    picture.paste(sheet, (0, 0))
    picture.paste(draw_kitchen(after, width, sentence[:100]), (0, sheet.height))
    picture.save(context.output / "kitchen.png")
    animate(context.output / "kitchen.gif", kitchen.frames[:: max(1, len(kitchen.frames) // 60)], width // 2)
    context.logger.log(INFO if reached else WARNING, statement)
    return KitchenPlan(
        root=context.output,
        outcome="ok" if reached else "not_reached",
        summary={"steps": len(result.steps), "reached": reached},
    )


def _task(domain: str, folder: Path | None, parameters: PlanParameters, seed: int) -> Task:
    """Return the task that was asked for. Raises BadInput where a folder has fewer."""
    if folder is None:
        return tasks_of(domain, parameters.which, parameters.task, seed)[-1]
    tasks = [task for each in read_task_sets(folder, domain, seed) for task in each.tasks]
    if parameters.task > len(tasks):
        raise BadInput(f"{folder}: no task {parameters.task}", hint=f"--task 1 to --task {len(tasks)}")
    return tasks[parameters.task - 1]


def missing_of(memory: Memory, result: Attempt) -> str:
    """Return which predicate nothing that was learned can make true, when that is why there is no plan."""
    if not result.unreachable:
        return ""
    names = sorted({atom[0] for atom in result.unreachable})
    added = {atom[0] for schema in memory.domain("learned").schemas for atom in schema.add}
    never = [name for name in names if name not in added]
    if never:
        return "; ".join(f"no operator was learned that makes {name} true" for name in never)
    atoms_text = ", ".join(" ".join(atom) for atom in result.unreachable)
    return f"no operator that was learned can make this true here: {atoms_text}"


def _statement(task: Task, sentence: str, result: Attempt, reached: bool, missing: str) -> str:
    if missing:
        return f"{sentence}: {missing}"
    outcome = "reached" if reached else why_not(result)
    return f"{sentence}: {outcome} in {len(result.steps)} actions, from task {task.name}"
