"""The step `predicates teach`: training tasks with a simulated teacher, and what was learned of her sentences."""

from __future__ import annotations

from pathlib import Path

from schemas.learned_domain import LearnedDomain
from stages.kit.stage import Context
from stages.kit.tasks.pddl import domain_text
from stages.predicates.language.saying import say
from stages.predicates.learning.grammar import GIVEN
from stages.predicates.learning.memory import Memory
from stages.predicates.learning.ours import OursLearner
from stages.predicates.learning.records import document_of, memory_of
from stages.predicates.parameters import TeachParameters
from stages.predicates.pictures import draw_predicates
from stages.predicates.tasks import tasks_of
from stages.predicates.teacher.simulated import SimulatedTeacher
from stages.predicates.training import train
from stages.predicates.world.catalogue import kitchen_file


def run(learned: LearnedDomain | None, *, parameters: TeachParameters, context: Context) -> LearnedDomain:
    """Teach; what `learned` holds is known from the beginning."""
    memory = memory_of(learned.info, str(learned.root)) if learned is not None else Memory()
    before = memory.sentences
    teacher = SimulatedTeacher(parameters.domain, context.seed, parameters.wording, parameters.wrong)
    learner = OursLearner(teacher, kitchen_file().domains[parameters.domain].actions, context.seed, memory)
    with context.progress.step("teach"):
        tasks = tasks_of(parameters.domain, "train", parameters.tasks, context.seed)
        training = train(learner, parameters.domain, tasks)
    heard = memory.sentences - before
    domain = memory.domain(parameters.domain)
    statement = (
        f"{len(memory.meanings)} phrases and {len(domain.schemas)} operators out of {heard} sentences and "
        f"{training.actions} actions ({training.refused} refused); "
        f"{training.reached} of {training.episodes} goals reached"
    )
    document = document_of(
        memory,
        domain=parameters.domain,
        teacher=f"simulated, {parameters.wording}, {parameters.wrong:g} wrong",
        physics=tuple(training.physics),
        statement=statement,
    )
    document.write(context.output / "domain.json")
    (context.output / "domain.pddl").write_text(domain_text(domain), encoding="utf-8")
    write_predicates(memory, context.output)
    summary = {
        "predicates": len(memory.predicates()),
        "operators": len(domain.schemas),
        "sentences": heard,
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
    if memory.states:
        learned = [each for name, each in predicates.items() if name not in GIVEN] or list(GIVEN.values())
        draw_predicates(learned, memory.states[0], predicates).save(output / "predicates.png")
