"""Learning from corrections: phrases, meanings, contradictions, operators, and goals that were never taught."""

from __future__ import annotations

import pytest
from scenewright.stages.kit.predicates.expressions import read, text_of
from scenewright.stages.kit.predicates.goal_words import goal_phrases
from scenewright.stages.kit.tasks.pddl import domain_text, parse_domain
from scenewright.stages.predicates.execution import attempt
from scenewright.stages.predicates.learning.operators import Transition, learn_operators, lift
from scenewright.stages.predicates.learning.ours import OursLearner
from scenewright.stages.predicates.learning.phrases import Phrase, phrase_of
from scenewright.stages.predicates.learning.synthesis import Label, Synthesiser
from scenewright.stages.predicates.state import Seen, State
from scenewright.stages.predicates.tasks import tasks_of
from scenewright.stages.predicates.teacher.simulated import SimulatedTeacher
from scenewright.stages.predicates.training import train
from scenewright.stages.predicates.truth import truth_of
from scenewright.stages.predicates.world.catalogue import kitchen_file


def taught(domain: str, wrong: float = 0.0, wording: str = "plain", tasks: int = 10) -> OursLearner:
    teacher = SimulatedTeacher(domain, 0, wording, wrong)  # type: ignore[arg-type]
    learner = OursLearner(teacher, kitchen_file().domains[domain].actions, 0)
    train(learner, domain, tasks_of(domain, "train", tasks, 77))
    return learner


TABLE = State(
    {
        "can": Seen(0.0, 0.0, 3.0, 3.0, "can"),
        "bread": Seen(0.0, 3.0, 3.0, 3.0, "food"),
        "shelf": Seen(-9.0, 0.0, 8.0, 4.0, "shelf"),
        "cup": Seen(9.0, 0.0, 4.0, 4.0, "cup", 1.2),
    }
)


@pytest.mark.parametrize(
    ("sentence", "means"),
    [
        ("object shelf can not be grasped by the gripper as it is too wide", "(less (width ?a) (largest_opening))"),
        ("you can't pick up object shelf because it is too large", "(less (width ?a) (largest_opening))"),
        ("object can is not thin enough as its height is greater than 1.0", "(less (height ?a) 1)"),
        ("there is another object on object can so you can't pick it up", "(not (some ?x (rests_on ?x ?a)))"),
        ("object cup already contains water", "(less (water ?a) 0.2)"),
        ("object can is not a plate", "(is (category ?a) plate)"),
        ("object can is not on object shelf", "(rests_on ?a ?b)"),
    ],
)
def test_one_sentence_is_enough_to_guess_what_it_means(sentence: str, means: str) -> None:
    phrase, objects = phrase_of(sentence, TABLE.objects)
    meaning = Synthesiser([TABLE]).best(phrase, [Label(0, objects, False, "sentence")])
    assert text_of(meaning.means) == means


def test_thresholds_that_nobody_says_come_of_the_labels() -> None:
    phrase = Phrase("object <1> is odd", 1)
    labels = [
        Label(0, (name,), name == "can", "answer") for name in ("can", "shelf", "cup")
    ]  # widths 3, 8, 4: the middle is 3.5
    meaning = Synthesiser([TABLE]).best(phrase, [*labels, Label(0, ("bread",), True, "answer")])
    assert not meaning.violated
    assert "3.5" in text_of(meaning.means)


def test_many_labels_outweigh_a_wrong_one() -> None:
    phrase = Phrase("object <1> does not contain water", 1)
    labels = [Label(0, (name,), name == "cup", "answer") for name in TABLE.objects]
    meaning = Synthesiser([TABLE]).best(phrase, [*labels, Label(0, ("cup",), False, "sentence")])
    assert meaning.violated == (4,)


def test_every_sentence_of_the_teacher_is_read_back_as_she_meant_it() -> None:
    for name, meant in truth_of("store_objects").file.predicates.items():
        for sentence in (*meant.lacks, *meant.unmet):
            said = sentence.replace("<1>", "can").replace("<2>", "shelf")
            phrase, objects = phrase_of(said, TABLE.objects)
            assert phrase.text == sentence, name
            assert objects == ("can", "shelf")[: meant.arguments]


def test_goals_are_taken_apart() -> None:
    parts = goal_phrases("Stack bread on can and put cup on the table.", TABLE.objects)
    assert parts == [("stack <1> on <2>", ("bread", "can")), ("put <1> on the table", ("cup",))]


def test_changes_are_lifted_and_accidents_left_out() -> None:
    action = ("pick_up", "bread")
    assert lift(action, frozenset({("held", "bread"), ("clear", "can")}), frozenset()) == (
        frozenset({("held", "?a"), ("clear", "?x")}),
        frozenset(),
    )
    assert lift(action, frozenset({("clear", "can"), ("clear", "cup")}), frozenset()) is None
    atoms = [frozenset({("free",)}), frozenset({("held", "bread")}), frozenset({("free",), ("odd", "bread")})]
    transitions = [Transition(action, 0, 1)] * 30 + [Transition(action, 0, 2)]
    domain = learn_operators("d", {"free": 0, "held": 1, "odd": 1}, transitions, atoms, {})
    assert [schema.add for schema in domain.schemas] == [(("held", "?a"),)]


@pytest.mark.parametrize("wrong", [0.0, 0.1])
def test_towers_are_built_that_were_never_taught(wrong: float) -> None:
    learner = taught("store_objects", wrong)
    memory = learner.memory
    domain = memory.domain("store_objects")
    assert parse_domain(domain_text(domain)) == domain
    assert memory.sentences <= 13
    for task in tasks_of("store_objects", "combined", 1, 0):
        goal, unknown = memory.goal_atoms(goal_phrases(task.sentence, task.objects))
        assert not unknown
        assert attempt(task, "store_objects", domain, memory.see, goal, replan=True).success


def test_the_same_seed_learns_the_same() -> None:
    one, two = (taught("set_table", 0.1, "diverse", tasks=3).memory for _ in range(2))
    assert one.dialogue == two.dialogue and one.meanings == two.meanings


def test_what_was_never_named_is_said() -> None:
    memory = taught("store_objects", tasks=1).memory
    _, unknown = memory.goal_atoms(goal_phrases("hide can behind shelf", TABLE.objects))
    assert unknown == ("hide <1> behind <2>",)


def test_a_wrong_sentence_is_asked_about_again_and_no_longer_believed() -> None:
    learner = OursLearner(SimulatedTeacher("store_objects", 0), ("pick_up",), 0)
    learner.refused(TABLE, ("pick_up", "can"), "object can is not on the table")
    assert learner.memory.disbelieved == ["object can is not on the table"]
    assert [turn.text for turn in learner.memory.dialogue][1:] == [
        "Is it so that object can is not on the table?",
        "no",
    ]
    assert learner.memory.preconditions() == {}
    assert read("(rests_on_table ?a)", "") == next(iter(learner.memory.meanings.values()))
