"""`predicates teach | plan | evaluate`, as a user runs them, and what they refuse."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pytest
from scenewright.cli.main import run as run_command
from scenewright.stages.kit.tasks import fast_downward
from scenewright.stages.predicates.learning.records import document_of, memory_of


def run(*words: str) -> int:
    return run_command(["predicates", *words, "--quiet"])


@pytest.fixture(scope="module")
def learned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("predicates") / "learned"
    assert run("teach", "--domain", "store_objects", "--tasks", "4", "--seed", "2", "--out", str(folder)) == 0
    return folder


def test_a_tower_is_built_and_what_is_missing_is_said(learned: Path, tmp_path: Path) -> None:
    given = ("--learned", str(learned), "--which", "novel_goals", "--image-width", "240")
    assert run("plan", *given, "--out", str(tmp_path / "plan")) == 0
    plan = json.loads((tmp_path / "plan" / "plan.json").read_text())
    assert plan["success"] and plan["steps"] and (tmp_path / "plan" / "kitchen.gif").is_file()
    assert run("plan", *given, "--goal", "pour water into coaster", "--out", str(tmp_path / "odd")) == 4
    assert "nobody has said what 'pour water into <1>' means" in (tmp_path / "odd" / "plan.json").read_text()


def test_what_was_learned_is_counted(learned: Path, tmp_path: Path) -> None:
    out = tmp_path / "evaluation"
    assert run("evaluate", "--learned", str(learned), "--each", "1", "--states", "20", "--out", str(out)) == 0
    results = json.loads((out / "results.json").read_text())
    assert [row["ceiling"] for row in results["rows"]] == [1, 1, 1, 1]
    assert min(results["accuracy"].values()) > 0.9


def test_tasks_of_ones_own_are_tried_and_their_sentences_read(
    learned: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    objects = {"shelf": [-5, 0], "coaster": [10, 0], "fruitcan": [-20, 0]}
    goal = [["on", "coaster", "shelf"], ["on", "fruitcan", "coaster"]]
    texts = ("Stack coaster and fruitcan on shelf in order.", "Hide coaster.", "Stack fruitcan on shelf.")
    tasks = {str(k): {"objects": objects, "goal_text": text, "goal_lits_gt": goal} for k, text in enumerate(texts)}
    (tmp_path / "tasks.json").write_text(json.dumps(tasks))
    given = ("--learned", str(learned), "--tasks", str(tmp_path / "tasks.json"))
    assert run("evaluate", *given, "--states", "20", "--out", str(tmp_path / "evaluation")) == 0
    (row,) = json.loads((tmp_path / "evaluation" / "results.json").read_text())["rows"]
    assert (row["tasks"], row["reached"], row["understood"]) == (3, 3, 1)
    assert row["tried"][0]["unread"] == "" and "'hide' is neither an object" in row["tried"][1]["unread"]
    assert row["tried"][2]["unread"] == "read as rests_on fruitcan shelf, which is not what the task wants"
    assert "1 of 3 sentences mean what their tasks want" in (tmp_path / "evaluation" / "table.md").read_text()
    capsys.readouterr()
    small = (*given, "--image-width", "240")
    assert run("plan", *small, "--task", "2", "--out", str(tmp_path / "plan")) == 0
    assert "'hide' is neither an object" in capsys.readouterr().err  # though --quiet
    plan = json.loads((tmp_path / "plan" / "plan.json").read_text())
    assert plan["success"] and "'hide'" in plan["unread"] and len(plan["steps"]) == 4
    assert run("plan", *small, "--task", "4", "--out", str(tmp_path / "none")) == 3
    assert run("plan", *small, "--goal", "hide coaster", "--out", str(tmp_path / "odd")) == 4
    assert "'hide' is neither an object" in capsys.readouterr().err  # though --quiet


def test_a_memory_comes_back_from_its_document(learned: Path) -> None:
    from scenewright.schemas.learned_domain import LearnedDomain

    document = LearnedDomain(root=learned).info
    memory = memory_of(document, "here")
    rest = {name: getattr(document, name) for name in ("domain", "teacher", "physics", "statement")}
    assert document_of(memory, **rest) == document


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda d: d["predicates"][0].update(means="(less (width ?a) (width ?a))", name="less"),
            "word of the language",
        ),
        (lambda d: d["predicates"][-1].update(means="(less (over 1 "), "brackets"),
        (lambda d: d["phrases"][0].update(predicate="nothing"), "no predicate"),
        (lambda d: d["transitions"][0].update(before=10**6), "not there"),
        (lambda d: d["goals"][0].update(phrase=999), "no phrase"),
    ],
)
def test_a_damaged_document_is_refused_in_one_line(learned: Path, change, message: str) -> None:  # type: ignore[no-untyped-def]
    from scenewright.schemas.errors import BadInput
    from scenewright.schemas.learned_domain import LearnedDomainFile

    document = json.loads((learned / "domain.json").read_text())
    change(document)
    with pytest.raises(BadInput, match=message) as refused:
        memory_of(LearnedDomainFile.model_validate(document), "domain.json")
    assert "\n" not in str(refused.value)


def test_an_unknown_set_is_refused(learned: Path, tmp_path: Path) -> None:
    assert run("evaluate", "--learned", str(learned), "--sets", "odd", "--out", str(tmp_path / "none")) == 2


def test_what_was_learned_is_shown_in_words(learned: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["predicates", "show", str(learned)]) == 0
    shown = capsys.readouterr().out
    assert "be_grasped_by_gripper (a): the width of a is less than the gripper's largest opening." in shown
    assert "makes true in_gripper(?a)" in shown and "'stack <1> on <2>' wants" in shown
    assert run_command(["predicates", "show", str(learned), "--predicate", "be_grasped_by_gripper"]) == 0
    assert ": sentence, 'object shelf can not be grasped" in capsys.readouterr().out
    assert run_command(["predicates", "show", str(learned), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["domain"] == "store_objects"
    assert run_command(["predicates", "show", str(learned), "--predicate", "odd"]) == 2
    assert "choose one of in_gripper" in capsys.readouterr().err
    assert run_command(["predicates", "show", str(learned.parent)]) == 3


def test_fast_downward_plans_where_it_is_installed(learned: Path, tmp_path: Path) -> None:
    given = ("--learned", str(learned), "--which", "novel_goals", "--image-width", "240", "--planner", "fast-downward")
    installed = importlib.util.find_spec(fast_downward.PACKAGE) is not None
    assert run("plan", *given, "--out", str(tmp_path / "plan")) == (0 if installed else 5)
    assert (tmp_path / "plan").exists() == installed
