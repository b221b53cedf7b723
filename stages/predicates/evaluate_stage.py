"""The step `predicates evaluate`: sets of tasks with what was learned, beside the teacher's own operators."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.schemas.kitchen_plan import EvaluatedSet, KitchenEvaluation, KitchenEvaluationFile, TriedTask
from scenewright.schemas.learned_domain import LearnedDomain
from scenewright.stages.kit.stage import Context
from scenewright.stages.kit.tasks.strips import Domain
from scenewright.stages.predicates.execution import Attempt, World, attempt, oracle, why_not
from scenewright.stages.predicates.learning.memory import Memory
from scenewright.stages.predicates.learning.records import memory_of
from scenewright.stages.predicates.learning.thesis_memory import ThesisMemory
from scenewright.stages.predicates.measure.accuracy import accuracies
from scenewright.stages.predicates.parameters import EvaluateParameters
from scenewright.stages.predicates.room.tasks import open_room, read_rooms, room_tasks
from scenewright.stages.predicates.task_folder import read_task_sets
from scenewright.stages.predicates.tasks import Task, tasks_of
from scenewright.stages.predicates.training import Opened, in_the_kitchen
from scenewright.stages.predicates.truth import ROOM


def run(
    learned: LearnedDomain, scene: Path | None, tasks: Path | None, *, parameters: EvaluateParameters, context: Context
) -> KitchenEvaluation:
    """Count. What was learned in rooms is tried in those of `scene`, what was learned in the kitchen in that of drawn
    tasks, or in those of the folder `tasks`."""
    name = learned.info.domain
    memory = memory_of(learned.info, str(learned.root))
    domain = memory.domain(name)
    replan = not isinstance(memory, ThesisMemory)  # the thesis follows its plans open loop in tests
    sets = _sets(name, scene, tasks, parameters, context.seed, str(learned.root))
    rows = []
    for which, drawn, opened in context.progress.track(sets, total=len(sets), description="sets"):
        attempts = [try_task(memory, domain, task, opened(task), replan) for task in drawn]
        tried = () if tasks is None else tuple(map(partial(_tried, memory), drawn, attempts))
        rows.append(
            EvaluatedSet(
                which=which,
                tasks=len(drawn),
                reached=sum(each.success for each in attempts),
                ceiling=sum(oracle(task, name, opened(task)).success for task in drawn),
                unplanned=sum(bool(each.unplanned) for each in attempts),
                failed_actions=sum(bool(reason) for each in attempts for _, reason in each.steps),
                understood=None if tasks is None else sum(not each.unread for each in tried),
                tried=tried,
            )
        )
        for line in _shortcomings(tried):
            context.logger.warning(line)
    accuracy = {} if name == ROOM else accuracies(memory, name, parameters.states, context.seed)
    file = KitchenEvaluationFile(domain=name, seed=context.seed, rows=tuple(rows), accuracy=accuracy)
    file.write(context.output / "results.json")
    (context.output / "table.md").write_text(as_markdown(file), encoding="utf-8")
    summary = {row.which: f"{row.reached} of {row.tasks}" for row in rows}
    return KitchenEvaluation(root=context.output, summary=summary)


def _tried(memory: Memory, task: Task, result: Attempt) -> TriedTask:
    """Return how a task of one's own went, and whether its sentence means what it wants."""
    goal, unread = memory.wanted(task.said, task.objects)
    if not unread and goal != memory.wanted(task.sentence, task.objects)[0]:
        unread = f"read as {', '.join(' '.join(atom) for atom in sorted(goal))}, which is not what the task wants"
    why = "" if result.success else why_not(result)
    return TriedTask(
        name=task.name, sentence=task.said, unread=unread, reached=result.success, actions=len(result.steps), why=why
    )


def _sets(
    name: str, scene: Path | None, folder: Path | None, parameters: EvaluateParameters, seed: int, where: str
) -> list[tuple[str, list[Task], Opened]]:
    if (name == ROOM) != (scene is not None):
        hint = "give the rooms to try it in: --scene FOLDER" if name == ROOM else "leave --scene out"
        raise BadInput(f"{where}: was learned in {'rooms' if name == ROOM else 'the kitchen'}", hint=hint)
    if scene is not None:
        return [("rooms", [*room_tasks(read_rooms(scene, parameters.robot), parameters.each, seed)], open_room)]
    if folder is not None:
        return [(each.name, [*each.tasks], in_the_kitchen) for each in read_task_sets(folder, name, seed)]
    return [(which, tasks_of(name, which, parameters.each, seed), in_the_kitchen) for which in parameters.sets]


def try_task(memory: Memory, domain: Domain, task: Task, world: World, replan: bool = True) -> Attempt:
    """Try a task with what a memory has learned; a goal that nobody explained is not tried."""
    goal, lacking = memory.wanted(task.sentence, task.objects)
    if lacking:
        return Attempt(unplanned=lacking)
    return attempt(task, task.name.split("/")[0], domain, memory.see, goal, replan=replan, world=world)


def _shortcomings(tried: Iterable[TriedTask]) -> list[str]:
    """Return a line for each sentence that was not understood, and for each task that was not reached."""
    unread = [f"{each.name}, {each.sentence!r}: {each.unread}" for each in tried if each.unread]
    return unread + [f"{each.name}: not reached, {each.why}" for each in tried if not each.reached]


def as_markdown(file: KitchenEvaluationFile) -> str:
    """Return the results as tables."""
    lines = [f"{file.domain}, tasks of seed {file.seed}.", "", "| set | reached | teacher's own operators | no plan |"]
    lines.append("|---|--:|--:|--:|")
    lines += [
        f"| {row.which} | {row.reached}/{row.tasks} | {row.ceiling}/{row.tasks} | {row.unplanned} |"
        for row in file.rows
    ]
    for row in file.rows:
        if row.understood is not None:
            lines += ["", f"{row.which}: {row.understood} of {row.tasks} sentences mean what their tasks want."]
        lines += [f"- {line}" for line in _shortcomings(row.tried)]
    lines += ["", "| predicate | balanced accuracy |", "|---|--:|"]
    lines += [f"| {name} | {value:.3f} |" for name, value in file.accuracy.items()]
    return "\n".join(lines) + "\n"
