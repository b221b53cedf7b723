"""The step `predicates evaluate`: sets of tasks with what was learned, beside the teacher's own operators."""

from __future__ import annotations

from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.schemas.kitchen_plan import EvaluatedSet, KitchenEvaluation, KitchenEvaluationFile
from scenewright.schemas.learned_domain import LearnedDomain
from scenewright.stages.kit.predicates.goal_words import goal_phrases
from scenewright.stages.kit.stage import Context
from scenewright.stages.kit.tasks.strips import Domain
from scenewright.stages.predicates.execution import Attempt, World, attempt, oracle
from scenewright.stages.predicates.learning.memory import Memory
from scenewright.stages.predicates.learning.records import memory_of
from scenewright.stages.predicates.learning.thesis_memory import ThesisMemory
from scenewright.stages.predicates.measure.accuracy import accuracies
from scenewright.stages.predicates.parameters import EvaluateParameters
from scenewright.stages.predicates.room.tasks import open_room, read_rooms, room_tasks
from scenewright.stages.predicates.tasks import Task, tasks_of
from scenewright.stages.predicates.training import Opened, in_the_kitchen
from scenewright.stages.predicates.truth import ROOM


def run(
    learned: LearnedDomain, scene: Path | None, *, parameters: EvaluateParameters, context: Context
) -> KitchenEvaluation:
    """Count. What was learned in rooms is tried in those of `scene`."""
    name = learned.info.domain
    memory = memory_of(learned.info, str(learned.root))
    domain = memory.domain(name)
    replan = not isinstance(memory, ThesisMemory)  # the thesis follows its plans open loop in tests
    sets = _sets(name, scene, parameters, context.seed, str(learned.root))
    rows = []
    for which, tasks, opened in context.progress.track(sets, total=len(sets), description="sets"):
        tried = [try_task(memory, domain, task, opened(task), replan) for task in tasks]
        rows.append(
            EvaluatedSet(
                which=which,
                tasks=len(tasks),
                reached=sum(each.success for each in tried),
                ceiling=sum(oracle(task, name, opened(task)).success for task in tasks),
                unplanned=sum(bool(each.unplanned) for each in tried),
                failed_actions=sum(bool(reason) for each in tried for _, reason in each.steps),
            )
        )
    accuracy = {} if name == ROOM else accuracies(memory, name, parameters.states, context.seed)
    file = KitchenEvaluationFile(domain=name, seed=context.seed, rows=tuple(rows), accuracy=accuracy)
    file.write(context.output / "results.json")
    (context.output / "table.md").write_text(as_markdown(file), encoding="utf-8")
    summary = {row.which: f"{row.reached} of {row.tasks}" for row in rows}
    return KitchenEvaluation(root=context.output, summary=summary)


def _sets(
    name: str, scene: Path | None, parameters: EvaluateParameters, seed: int, where: str
) -> list[tuple[str, list[Task], Opened]]:
    if (name == ROOM) != (scene is not None):
        hint = "give the rooms to try it in: --scene FOLDER" if name == ROOM else "leave --scene out"
        raise BadInput(f"{where}: was learned in {'rooms' if name == ROOM else 'the kitchen'}", hint=hint)
    if scene is not None:
        return [("rooms", [*room_tasks(read_rooms(scene), parameters.tasks, seed)], open_room)]
    return [(which, tasks_of(name, which, parameters.tasks, seed), in_the_kitchen) for which in parameters.sets]


def try_task(memory: Memory, domain: Domain, task: Task, world: World, replan: bool = True) -> Attempt:
    """Try a task with what a memory has learned; a goal that nobody explained is not tried."""
    goal, unknown = memory.goal_atoms(goal_phrases(task.sentence, task.objects))
    if unknown:
        return Attempt(unplanned=f"nobody has said what {unknown[0]!r} means")
    return attempt(task, task.name.split("/")[0], domain, memory.see, goal, replan=replan, world=world)


def as_markdown(file: KitchenEvaluationFile) -> str:
    """Return the results as tables."""
    lines = [f"{file.domain}, tasks of seed {file.seed}.", "", "| set | reached | teacher's own operators | no plan |"]
    lines.append("|---|--:|--:|--:|")
    lines += [
        f"| {row.which} | {row.reached}/{row.tasks} | {row.ceiling}/{row.tasks} | {row.unplanned} |"
        for row in file.rows
    ]
    lines += ["", "| predicate | balanced accuracy |", "|---|--:|"]
    lines += [f"| {name} | {value:.3f} |" for name, value in file.accuracy.items()]
    return "\n".join(lines) + "\n"
