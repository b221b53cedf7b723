"""Tasks of one's own in the form of InterPreT's authors: read, tried, refused in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.predicates.task_folder import read_task_sets

from tests.real_data import real_data


def task(**changes: Any) -> dict[str, Any]:
    """A task as the authors write it; a change of None takes a key out."""
    written: dict[str, Any] = {
        "objects": {"shelf": [-5, 0], "coaster": [10.5, 0.0], "fruitcan": [-5, 4.0]},
        "goal_text": "Stack coaster on shelf.",
        "goal_lits_gt": [["on", "coaster", "shelf"]],
    }
    return {key: value for key, value in (written | changes).items() if value is not None}


def write(path: Path, *tasks: Any) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({str(number): each for number, each in enumerate(tasks, start=1)}))
    return path


def test_a_folder_of_several_domains_gives_the_tasks_of_one(tmp_path: Path) -> None:
    write(tmp_path / "StoreObjects/train/train.json", task(), task(goal_text=None))
    write(tmp_path / "StoreObjects/hard/hard.json", task())
    write(tmp_path / "CookMeal/train/train.json", task(objects={"no": [0, 0]}))
    (tmp_path / "actions.json").write_text('{"pick_up": {"raw": "pick_up(a)"}}')
    hard, train = read_task_sets(tmp_path, "store_objects", 3)
    assert (hard.name, train.name) == ("StoreObjects/hard/hard", "StoreObjects/train/train")
    first, second = train.tasks
    assert first.objects["fruitcan"] == (-5.0, 4.0) and first.goal == (("on", "coaster", "shelf"),)
    assert (first.said, second.said) == ("Stack coaster on shelf.", "") and second.sentence == "stack coaster on shelf"
    assert first.name == "store_objects/StoreObjects/train/train/1"
    assert read_task_sets(tmp_path / "StoreObjects/train/train.json", "store_objects", 3)[0].name == "train"
    with pytest.raises(BadInput, match="no task of set_table in a JSON file there, only of cook_meal, store_objects"):
        read_task_sets(tmp_path, "set_table", 3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"objects": {"shelf": [-5, 0], "teapot": [4, 0]}}, "no object 'teapot' in the kitchen"),
        ({"objects": {"shelf": [-5, 0], "coaster": [4, float("nan")]}}, "objects.coaster.1: .*finite"),
        ({"objects": {"shelf": [-5, 0], "coaster": [4]}}, "objects.coaster"),
        ({"objects": {"shelf": [-5, 0], "coaster": [45, 0]}}, r"coaster at \(45, 0\) is not above the table"),
        ({"objects": {"shelf": [-5, 0], "coaster": [9, 1.25]}}, r"coaster at \(9, 1.25\) stands on nothing"),
        ({"objects": {"shelf": [-5, 0], "coaster": [-4, 0]}}, "shelf and coaster are in the same place"),
        ({"objects": None}, "objects: Field required"),
        ({"goal_lits_gt": []}, "goal_lits_gt"),
        ({"goal_lits_gt": [["on", "coaster"]]}, "'on coaster' needs 2 objects"),
        ({"goal_lits_gt": [["on", "bread", "shelf"]]}, "bread is not an object of the task"),
        ({"goal_lits_gt": [["has_water", "coaster"]]}, "'has_water coaster' is none of store_objects"),
        ({"goal_lits_gt": [["clear_on_top", "coaster"]]}, "'clear_on_top coaster' is none of store_objects"),
        ({"comment": "mine"}, "comment: Extra"),
    ],
)
def test_a_damaged_task_is_refused_in_one_line(changes: dict[str, Any], message: str, tmp_path: Path) -> None:
    path = write(tmp_path / "tasks.json", task(), task(**changes))
    for given in (path, tmp_path):
        with pytest.raises(BadInput, match=f"tasks.json, task '2': .*{message}") as refused:
            read_task_sets(given, "store_objects", 0)
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [('{"1": {"objects": ', "no JSON"), ("[]", "no task of"), ('{"a": 1}', "no task of"), (None, "no task of")],
)
def test_a_folder_without_tasks_is_refused_in_one_line(text: str | None, message: str, tmp_path: Path) -> None:
    if text is not None:
        (tmp_path / "tasks.json").write_text(text)
    with pytest.raises(BadInput, match=message):
        read_task_sets(tmp_path, "store_objects", 0)


@pytest.mark.parametrize("domain", ["store_objects", "set_table", "cook_meal"])
def test_the_authors_training_tasks_are_read(domain: str) -> None:
    (train,) = read_task_sets(real_data("interpret"), domain, 0)
    assert [each.name.rsplit("/", 1)[1] for each in train.tasks] == [str(number) for number in range(1, 11)]
    assert all(each.said for each in train.tasks)
