"""The steps of `predicates`."""

from __future__ import annotations

import json
from pathlib import Path

from tests.advice.rows import Tried

PARAMETERS, PLAN_STAGE = "stages/predicates/parameters.py", "stages/predicates/plan_stage.py"
EVALUATE = "predicates evaluate --learned {golden}/learned_domain --states 20 --sets canonical --out out"
PLAN = "predicates plan --learned {golden}/learned_domain --image-width 240 --accept not_reached --out out"


def one_task(folder: Path) -> None:
    """A folder with one task whose goal holds."""
    objects = {"shelf": [-5, 0], "coaster": [-5, 4]}
    task = {"objects": objects, "goal_text": "Stack coaster on shelf.", "goal_lits_gt": [["on", "coaster", "shelf"]]}
    (folder / "mine").mkdir()
    (folder / "mine" / "tasks.json").write_text(json.dumps({"1": task}))


def one_of_each(folder: Path) -> None:
    rows = json.loads((folder / "out/results.json").read_text())["rows"]
    assert [(row["which"], row["tasks"]) for row in rows] == [("canonical", 1)]


def the_folder(folder: Path) -> None:
    rows = json.loads((folder / "out/results.json").read_text())["rows"]
    assert [(row["which"], row["tasks"]) for row in rows] == [("tasks", 1)]


def that_task(folder: Path) -> None:
    assert json.loads((folder / "out/plan.json").read_text())["goal"] == "Stack coaster on shelf."


ROWS = [
    Tried(PARAMETERS, "it takes a folder", f"{EVALUATE} --tasks 1", f"{EVALUATE} --each 1", right=one_of_each),
    Tried(
        PARAMETERS,
        "--scene is of rooms",
        f"{EVALUATE} --tasks mine --scene mine",
        f"{EVALUATE} --tasks mine",
        given=one_task,
        right=the_folder,
    ),
    Tried(
        PLAN_STAGE,
        "no task",
        f"{PLAN} --tasks mine --task 2",
        f"{PLAN} --tasks mine --task 1",
        code=3,
        given=one_task,
        right=that_task,
    ),
]
