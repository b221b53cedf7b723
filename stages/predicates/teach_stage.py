"""The step `predicates teach`: training tasks with a teacher, and what was learned of her sentences."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.schemas.learned_domain import LearnedDomain
from scenewright.stages.kit.stage import Context
from scenewright.stages.kit.tasks.pddl import domain_text
from scenewright.stages.predicates.language.saying import say
from scenewright.stages.predicates.learning.memory import Memory
from scenewright.stages.predicates.learning.opening import Exchange, empty_memory, open_learner
from scenewright.stages.predicates.learning.records import document_of, memory_of
from scenewright.stages.predicates.learning.setting import KITCHEN, Setting
from scenewright.stages.predicates.learning.setting import ROOM as ROOM_SETTING
from scenewright.stages.predicates.learning.thesis_memory import ThesisMemory
from scenewright.stages.predicates.parameters import TeachParameters
from scenewright.stages.predicates.pictures import draw_learning, draw_predicates
from scenewright.stages.predicates.room.tasks import open_room, read_rooms, room_tasks
from scenewright.stages.predicates.tasks import Task, tasks_of
from scenewright.stages.predicates.teacher.opening import open_teacher
from scenewright.stages.predicates.training import Opened, in_the_kitchen, train
from scenewright.stages.predicates.truth import ROOM
from scenewright.stages.predicates.world.catalogue import kitchen_file


@dataclass(frozen=True)
class Course:
    """Where and what is taught."""

    domain: str
    setting: Setting
    actions: tuple[str, ...]
    tasks: list[Task]
    opened: Opened


def course_of(scene: Path | None, domain: str, count: int, seed: int, robot: str) -> Course:
    """Return the tasks of a kitchen, or of the rooms of a folder as a robot reaches them. Raises BadInput for rooms
    that are none, and as `load_robot` does."""
    if scene is None:
        tasks = tasks_of(domain, "train", count, seed)
        return Course(domain, KITCHEN, kitchen_file().domains[domain].actions, tasks, in_the_kitchen)
    rooms: list[Task] = [*room_tasks(read_rooms(scene, robot), count, seed)]
    return Course(ROOM, ROOM_SETTING, tuple(ROOM_SETTING.arity), rooms, open_room)


def run(
    learned: LearnedDomain | None,
    scene: Path | None,
    dialogue: Path | None,
    transcript: Path | None,
    *,
    parameters: TeachParameters,
    context: Context,
) -> LearnedDomain:
    """Teach in the kitchen, or in the rooms of `scene`; what `learned` holds is known from the beginning."""
    course = course_of(scene, parameters.domain, parameters.tasks, context.seed, parameters.robot)
    memory = empty_memory(parameters.learner, course.setting)
    if learned is not None:
        memory = memory_of(learned.info, str(learned.root))
        if isinstance(memory, ThesisMemory) != (parameters.learner == "thesis"):
            raise BadInput(f"{learned.root}: another learner learned it", hint=f"it was {learned.info.learner}")
        if memory.setting is not course.setting:
            raise BadInput(
                f"{learned.root}: was learned in a {memory.setting.name}, this is a {course.setting.name}",
                hint="begin without --learned",
            )
    before = memory.sentences
    teacher = open_teacher(parameters, course.domain, context.seed, dialogue, context.output / "teacher.jsonl")
    learner = open_learner(
        parameters, teacher, course.actions, context.seed, memory, Exchange(transcript, context.output)
    )
    with context.progress.step("teach"):
        training = train(learner, course.domain, course.tasks, course.opened)
    sentences_heard = memory.sentences - before
    domain = memory.domain(course.domain)
    statement = (
        f"{len(memory.meanings)} phrases and {len(domain.schemas)} operators out of {sentences_heard} sentences and "
        f"{training.actions} actions ({training.refused} refused); "
        f"{training.reached} of {training.episodes} goals reached"
    )
    document = document_of(
        memory,
        domain=course.domain,
        teacher=teacher.label,
        learner=learner.label,
        physics=tuple(training.physics),
        statement=statement,
    )
    document.write(context.output / "domain.json")
    (context.output / "domain.pddl").write_text(domain_text(domain), encoding="utf-8")
    write_predicates(memory, context.output)
    operators = {done: len(memory.domain(course.domain, done).schemas) for _, done, _ in training.course}
    draw_learning(
        [(phrases_known, operators[done], sentences_said) for phrases_known, done, sentences_said in training.course]
    ).save(context.output / "learning.png")
    summary = {
        "predicates": len(memory.predicates()),
        "operators": len(domain.schemas),
        "sentences": sentences_heard,
        "actions": training.actions,
        "reached": training.reached,
    }
    return LearnedDomain(root=context.output, summary=summary)


def write_predicates(memory: Memory, output: Path) -> None:
    """Write what every predicate means, as sentences and as plots."""
    predicates = memory.predicates()
    lines = [say(each) for each in predicates.values()]
    if memory.disbelieved:
        lines += ["", "No longer believed:", *(f"- {sentence}" for sentence in memory.disbelieved)]
    (output / "predicates.txt").write_text("\n".join([*lines, ""]), encoding="utf-8")
    if memory.states and memory.states[0].names:
        given_predicates = memory.setting.given
        learned = [each for name, each in predicates.items() if name not in given_predicates] or list(
            given_predicates.values()
        )
        draw_predicates(learned, memory.states[0], predicates).save(output / "predicates.png")
