"""What words mean, learned from corrections: tables 5.2 to 5.5 (Han 2024), and a hundred goals a domain."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache

from pydantic import Field
from scenewright.stages.kit.language.chat import Chat, ChatSettings
from scenewright.stages.kit.language.scripted import ScriptedBackend
from scenewright.stages.kit.predicates.expressions import text_of
from scenewright.stages.kit.predicates.goal_words import goal_phrases
from scenewright.stages.kit.predicates.vocabulary import Perceived
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.kit.tasks.pddl import domain_text
from scenewright.stages.kit.tasks.strips import Atom, Domain
from scenewright.stages.kit.tasks.task_planner import TaskPlan
from scenewright.stages.predicates import (
    DOMAINS,
    KITCHEN_GIVEN,
    SETS,
    STAND_IN,
    Abstraction,
    Attempt,
    Done,
    Memory,
    OursLearner,
    Planner,
    RandomLearner,
    Replayed,
    Replays,
    SimulatedTeacher,
    Task,
    ThesisLearner,
    ThesisMemory,
    Training,
    Wording,
    World,
    allowed_accuracy,
    attempt,
    balanced_accuracy,
    drawn_cases,
    expected_share,
    kitchen_file,
    oracle,
    stand_in,
    tasks_of,
    timed_plan,
    train,
    true_domain,
    truth_of,
)

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, count, mean
from benchmarks.tabulation import markdown

TUNING, REPORTING = range(210), range(300, 310)
TRAINING_TASKS, SET_TASKS = 10, 10
OF_TRAINING, OF_TESTS = 1000, 7000
"""Added to a seed for its training tasks; the seed of the tests, which all share."""
BEFORE = {"store_objects": "set_table", "set_table": "store_objects", "cook_meal": "store_objects"}
"""Domain -> the one that was taught before it, bootstrapped."""
TEACHERS: dict[str, tuple[Wording, float]] = {
    "ours": ("plain", 0.0),
    "ours_bootstrapped": ("plain", 0.0),
    "ours_diverse": ("diverse", 0.0),
    "ours_wrong": ("plain", 0.1),
    "random": ("plain", 0.0),
    "thesis": ("plain", 0.0),
}
ARMS = {
    "oracle": "oracle: the teacher's own operators",
    "ours": "ours, from scratch",
    "ours_bootstrapped": "ours, after another domain",
    "ours_diverse": "ours, diverse wording",
    "ours_wrong": "ours, 10 % of corrections wrong or missing",
    "random": "ours, exploring by chance",
    "thesis": "the thesis's algorithm, a scripted stand-in for its language model",
}


Scores = tuple[float, float]


class InterpretParameters(Parameters):
    """Sizes."""

    goals: int = Field(100, ge=1, le=200, description="Generated goals a domain")
    states: int = Field(10_000, ge=10, le=100_000, description="States that each predicate is judged on")


@dataclass(frozen=True)
class Record:
    """One training seed on one set of tasks."""

    reached: int
    ceiling: int
    tasks: int
    unplanned: int
    failed_actions: int
    sentences: float
    questions: float
    transitions: float
    language_calls: float
    accuracy: float
    worst_accuracy: float
    allowed_accuracy: float
    expected: float
    disbelieved: float
    physics: float
    train_seconds: float
    plan_seconds: float


@dataclass
class Known:
    """What the trials of a domain share: what came of actions, and plans."""

    replays: Replays = field(default_factory=dict)
    plans: dict[tuple[object, ...], tuple[TaskPlan, float]] = field(default_factory=dict)
    by_oracle: dict[str, list[Attempt]] = field(default_factory=dict)
    """Set of tasks -> what came of the teacher's own operators, which no seed changes."""
    tried: dict[tuple[object, ...], Attempt] = field(default_factory=dict)
    """What came of tasks, for learners that learned the same."""
    accuracies: dict[tuple[str, object], float] = field(default_factory=dict)
    done: list[Done] = field(default_factory=list)
    """What the oracle did on the combined sets: operators are judged on it."""

    seen: dict[tuple[object, int], frozenset[Atom]] = field(default_factory=dict)

    def oracle(self, name: str, which: str, goals: int) -> list[Attempt]:
        """Return what came of a set of tasks by the teacher's own operators."""
        if which not in self.by_oracle:
            planner = self.planner(true_domain(name))
            self.by_oracle[which] = [
                oracle(task, name, Replayed(task, self.replays), planner) for task in tests(name, which, goals)
            ]
        return self.by_oracle[which]

    def see(self, memory: Memory) -> Abstraction:
        """Return a memory's abstraction, which evaluates each of the states in `replays` once."""
        key = seen_with(memory)

        def see(state: Perceived) -> frozenset[Atom]:
            if (key, id(state)) not in self.seen:
                self.seen[key, id(state)] = memory.see(state)
            return self.seen[key, id(state)]

        return see

    def planner(self, domain: Domain) -> Planner:
        """Return a planner that answers a question that was asked before as it did then, with the seconds of then."""
        text = domain_text(domain)

        def plan(
            domain: Domain,
            objects: list[str],
            atoms: frozenset[Atom],
            goal: frozenset[Atom],
            avoided: frozenset[Atom],
            longest: int,
        ) -> tuple[TaskPlan, float]:
            key = (text, tuple(objects), atoms, goal, avoided, longest)
            if key not in self.plans:
                self.plans[key] = timed_plan(domain, objects, atoms, goal, avoided, longest)
            return self.plans[key]

        return plan


def seen_with(memory: Memory) -> tuple[object, ...]:
    """Return what a memory's abstraction depends on."""
    return tuple((each.name, text_of(each.means)) for each in memory.predicates().values()), tuple(memory.used())


@cache
def tests(name: str, which: str, goals: int) -> tuple[Task, ...]:
    """Return the tasks of a set."""
    return tuple(tasks_of(name, which, goals if which == "hundred_goals" else SET_TASKS, OF_TESTS))


@dataclass
class Counted:
    """A world of which the processor's seconds are counted apart: those of physics are not the learner's."""

    world: World
    clock: list[float]

    def state(self) -> Perceived:
        """What is perceived now."""
        start = time.thread_time()
        state = self.world.state()
        self.clock[0] += time.thread_time() - start
        return state

    def do(self, action: Atom) -> str:
        """Do an action."""
        start = time.thread_time()
        reason = self.world.do(action)
        self.clock[0] += time.thread_time() - start
        return reason


@dataclass(frozen=True)
class Taught:
    """A learner after training."""

    memory: Memory
    domain: Domain
    training: Training
    sentences: int
    questions: int
    seconds: float
    """The processor's, physics left out."""
    calls: int


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Record]]:
    """Yield the trials of one domain."""
    known = Known()
    taught: dict[tuple[str, str], Taught] = {}
    judged: dict[tuple[str, str], tuple[Scores, Scores]] = {}
    for trial in sorted(trials, key=lambda trial: (list(ARMS).index(trial.arm), trial.seed)):
        name, which = trial.case.split("/")
        goals = bench.parameters.goals
        by_oracle = known.oracle(name, which, goals)
        ceiling = sum(each.success for each in by_oracle)
        if not known.done:
            combined = known.oracle(name, "combined", goals)
            known.done = list(_done(tests(name, "combined", goals), combined, known))
        if trial.arm == "oracle":
            met = 100.0 * expected_share(true_domain(name), truth_of(name).atoms, known.done)
            yield trial, _record(by_oracle, ceiling, None, (100.0, 100.0), (100.0, met))
            continue
        key = (trial.arm, trial.seed)
        if key not in taught:
            taught[key] = learned = teach(trial.arm, name, int(trial.seed), known)
            judged[key] = (
                _accuracy(learned.memory, name, bench.parameters.states, known),
                _operators(learned, name, known),
            )
        learned = taught[key]
        tried = [_tried(learned, name, task, known) for task in tests(name, which, goals)]
        yield trial, _record(tried, ceiling, learned, *judged[key])


def _done(tasks: Sequence[Task], tried: Sequence[Attempt], known: Known) -> Iterator[Done]:
    """Yield the actions that worked, with the states around them."""
    for task, each in zip(tasks, tried, strict=True):
        world = Replayed(task, known.replays)
        for action, reason in each.steps:
            before = world.state()
            world.do(action)
            if not reason:
                yield before, action, world.state()


def _operators(learned: Taught, name: str, known: Known) -> Scores:
    """Return how right what its operators allow is, and how often what they expect comes, in percent."""
    see, actions = known.see(learned.memory), kitchen_file().domains[name].actions
    allowed = allowed_accuracy(learned.domain, see, actions, name, [before for before, _, _ in known.done])
    return 100.0 * allowed, 100.0 * expected_share(learned.domain, see, known.done)


def teach(arm: str, name: str, seed: int, known: Known) -> Taught:
    """Return what an arm learns of a domain under a training seed."""
    wording, wrong = TEACHERS[arm]
    memory = ThesisMemory() if arm == "thesis" else Memory()
    if arm == "ours_bootstrapped":
        memory = teach("ours", BEFORE[name], seed, known).memory
    before = (memory.sentences, memory.questions)
    teacher = SimulatedTeacher(name, seed, wording, wrong)
    learner, calls = _learner(arm, teacher, name, seed, memory)
    clock, start = [0.0], time.thread_time()
    tasks = tasks_of(name, "train", TRAINING_TASKS, OF_TRAINING + seed)
    training = train(learner, name, tasks, lambda task: Counted(Replayed(task, known.replays), clock))
    seconds = time.thread_time() - start - clock[0]
    domain = memory.domain(name)
    return Taught(
        memory, domain, training, memory.sentences - before[0], memory.questions - before[1], seconds, calls()
    )


def _learner(
    arm: str, teacher: SimulatedTeacher, name: str, seed: int, memory: Memory
) -> tuple[OursLearner, Callable[[], int]]:
    """Return a learner, and what counts its language calls."""
    actions = kitchen_file().domains[name].actions
    if isinstance(memory, ThesisMemory):
        chat = Chat(ScriptedBackend(STAND_IN, stand_in), ChatSettings(call_budget=10**6, token_budget=10**9))
        return ThesisLearner(teacher, actions, seed, memory, chat=chat), lambda: chat.calls
    kind = RandomLearner if arm == "random" else OursLearner
    return kind(teacher, actions, seed, memory), lambda: 0


def _tried(learned: Taught, name: str, task: Task, known: Known) -> Attempt:
    wanted, unknown = learned.memory.goal_atoms(goal_phrases(task.sentence, task.objects))
    if unknown:
        return Attempt(unplanned=unknown[0])
    replan = not isinstance(learned.memory, ThesisMemory)
    key = (domain_text(learned.domain), seen_with(learned.memory), task.name, task.seed, wanted, replan)
    if key not in known.tried:
        see, planner, world = known.see(learned.memory), known.planner(learned.domain), Replayed(task, known.replays)
        known.tried[key] = attempt(task, name, learned.domain, see, wanted, replan=replan, world=world, planner=planner)
    return known.tried[key]


def _accuracy(memory: Memory, name: str, states: int, known: Known) -> Scores:
    """Return mean and least balanced accuracy [%] over the domain's predicates; one that was never heard of counts
    one half, what a coin would get."""
    found = dict.fromkeys((each for each in true_domain(name).predicates if each != "in_gripper"), 0.5)
    for phrase, means in memory.meanings.items():
        meant = truth_of(name).meant_by(phrase.text)
        if meant in found:
            key = (meant, means)
            if key not in known.accuracies:
                known.accuracies[key] = balanced_accuracy(
                    drawn_cases(meant, name, states, OF_TESTS), means, KITCHEN_GIVEN
                )
            found[meant] = max(found[meant], known.accuracies[key])
    return 100.0 * statistics.mean(found.values()), 100.0 * min(found.values())


def _record(
    tried: list[Attempt], ceiling: int, learned: Taught | None, predicates: Scores, operators: Scores
) -> Record:
    planning = [seconds for each in tried for seconds in each.planning]
    return Record(
        reached=sum(each.success for each in tried),
        ceiling=ceiling,
        tasks=len(tried),
        unplanned=sum(bool(each.unplanned) for each in tried),
        failed_actions=sum(bool(reason) for each in tried for _, reason in each.steps),
        sentences=float(learned.sentences) if learned else 0.0,
        questions=float(learned.questions) if learned else 0.0,
        transitions=float(learned.training.actions) if learned else 0.0,
        language_calls=float(learned.calls) if learned else 0.0,
        accuracy=predicates[0],
        worst_accuracy=predicates[1],
        allowed_accuracy=operators[0],
        expected=operators[1],
        disbelieved=float(len(learned.memory.disbelieved)) if learned else 0.0,
        physics=float(len(learned.training.physics)) if learned else 0.0,
        train_seconds=learned.seconds if learned else 0.0,
        plan_seconds=statistics.median(planning) if planning else 0.0,
    )


def share(part: str, whole: str) -> Callable[[Sequence[Record]], float | None]:
    """Return a figure: pooled counts over pooled counts, in percent."""

    def figure(records: Sequence[Record]) -> float | None:
        total = sum(getattr(record, whole) for record in records)
        return 100.0 * sum(getattr(record, part) for record in records) / total if total else None

    return figure


def middle(name: str) -> Callable[[Sequence[Record]], float | None]:
    """Return a figure: the median over seeds."""
    return lambda records: statistics.median(getattr(r, name) for r in records) if records else None


def printed(results: Results) -> str:
    """What the thesis prints."""
    rows = [
        ("store_objects/canonical", "93", "–"),
        ("store_objects/more_objects", "90", "–"),
        ("store_objects/novel_goals", "100", "–"),
        ("store_objects/combined", "100", "–"),
        ("set_table/canonical", "100", "100"),
        ("set_table/more_objects", "100", "100"),
        ("set_table/novel_goals", "53", "100"),
        ("set_table/combined", "37", "100"),
        ("cook_meal/canonical", "97", "–"),
        ("cook_meal/more_objects", "100", "–"),
        ("cook_meal/novel_goals", "100", "–"),
        ("cook_meal/combined", "83", "–"),
    ]
    return markdown("As printed (Han 2024), %, three runs of ten tasks", ("case", "InterPreT", "bootstrapped"), rows)


MEASURES = {
    "success": Measure(share("reached", "tasks"), "%"),
    "success_of_ceiling": Measure(share("reached", "ceiling"), "%"),
    "sentences": mean("sentences"),
    "questions": mean("questions"),
    "transitions": mean("transitions"),
    "language_calls": mean("language_calls"),
    "predicate_accuracy": mean("accuracy", "%"),
    "worst_predicate_accuracy": mean("worst_accuracy", "%"),
    "operator_accuracy": mean("allowed_accuracy", "%"),
    "effects_expected": mean("expected", "%"),
    "disbelieved": mean("disbelieved"),
    "physics_failures": mean("physics"),
    "unplanned": Measure(share("unplanned", "tasks"), "%"),
    "train_seconds": Measure(middle("train_seconds"), "s"),
    "plan_seconds": Measure(middle("plan_seconds"), "s"),
    "seeds": Measure(count, interval=False),
}
CASES = tuple(f"{domain}/{which}" for domain in DOMAINS for which in SETS)
EXPERIMENT = Experiment(
    name="interpret",
    title="What words mean, learned from corrections (InterPreT)",
    simulated=(
        "The kitchen (planar rigid bodies, drops of water), and a teacher who answers by the truth in "
        "template sentences. Tasks are drawn after the thesis's goal groups, whose own tests are not public "
        "here. No language model is asked."
    ),
    knows=(
        "What perception calls say, the teacher's sentences, a hand-written word list, the thesis's worked "
        "example (in_gripper, with its tolerance) and three relations of boxes."
    ),
    does_not_show="How a language model or a person would do: the word list knows these sentences' words, and most "
    "true meanings are a word or two of the grammar. The thesis's arm was run with a stand-in that guesses by the word "
    "list, no language model; Code-as-Policies and Inner Monologue were not run. The kitchen's grasps never slip.",
    arms=ARMS,
    cases=CASES,
    runs=lambda arm, case: True,
    tuning=tuple(map(str, TUNING)),
    reporting=tuple(map(str, REPORTING)),
    together=lambda trial: trial.case.split("/")[0],
    measure=measure,
    record=Record,
    measures=MEASURES,
    pairs=(("ours", "random"), ("ours_bootstrapped", "ours"), ("ours_wrong", "ours"), ("ours_diverse", "ours")),
    compared=("success", "sentences"),
    parameters=InterpretParameters,
    quick_seeds=1,
    quick={"goals": 10, "states": 200},
    notes=printed,
)
