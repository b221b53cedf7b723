"""The chain of TIDY on one table: scene, plan from its image, trial, report, and what the commands refuse."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from scenewright.cli.main import run
from scenewright.schemas.tableware_plan import FIELD_OF, TablewarePlanFile
from scenewright.schemas.tableware_scene import TablewareSceneFile
from scenewright.schemas.tableware_trial import TablewareTrialFile

from tests.unit.viewing.artifacts import seal


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("tidy")
    assert (
        run(["tableware", "scene", "--tier", "tier0_cups", "--seed", "5", "--out", str(out / "scene"), "--quiet"]) == 0
    )
    return out


def test_a_table_is_seen_planned_cleared_and_reported(folder: Path) -> None:
    scene, seen, plan, trial, report = (
        str(folder / name) for name in ("scene", "detections", "plan", "trial", "report")
    )
    small = ["--image-width", "300", "--quiet"]
    assert run(["tableware", "detect", scene, "--out", seen, "--quiet"]) == 0
    assert run(["tableware", "plan", "--detections", seen, "--draws", "5", "--out", plan, *small]) == 0
    assert run(["tableware", "simulate", "--scene", scene, "--plan", plan, "--out", trial, *small]) == 0
    shown = ["--tableware-detections", seen, "--tableware-plan", plan, "--tableware-trial", trial]
    assert run(["report", *shown, "--out", report, "--quiet"]) == 0

    planned = TablewarePlanFile.read(folder / "plan" / "plan.json")
    assert planned.source == "detections" and len(planned.items) == 6 and not planned.refused
    for step in planned.steps:
        assert getattr(step.action, FIELD_OF[step.action.name]) is not None
    assert planned.seconds == pytest.approx(sum(step.action.seconds for step in planned.steps))
    done = TablewareTrialFile.read(folder / "trial" / "trial.json")
    truth = TablewareSceneFile.read(folder / "scene" / "scene.json")
    binned = [name for step in done.steps for name in step.binned]
    left = [item.name for item in done.steps[-1].after]
    assert sorted([*binned, *left]) == sorted(item.name for item in truth.items)
    assert done.counts.moved == len(binned) and len(done.steps) == len(planned.steps)
    page = (folder / "report" / "report.html").read_text()
    assert "Clearing the table" in page and "data:image/gif;base64," in page and page.count("<img") == 4


def _scene(folder: Path, name: str, **changes: object) -> str:
    """A scene without images, about what somebody wrote into it."""
    root = folder / name
    root.mkdir()
    data = json.loads((folder / "scene" / "scene.json").read_text()) | changes
    (root / "scene.json").write_text(json.dumps(data))
    return str(seal(root, "tableware_scene"))


def _item(name: str, kind: str = "cup", x: float = 0.0, y: float = 0.0) -> dict[str, object]:
    return {"name": name, "kind": kind, "position": [x, y, 0.0], "yaw": 0.0, "on": None}


def _refused(capsys: pytest.CaptureFixture[str], code: int, *words: str) -> str:
    assert run(list(words)) == code
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error:")]
    assert len(lines) == 1
    return lines[0]


def test_an_empty_table_is_said(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, out = _scene(folder, "nothing", items=[]), str(folder / "empty")
    words = ("tableware", "plan", "--scene", scene, "--source", "truth", "--out", out, "--quiet")
    assert "the table is empty" in _refused(capsys, 4, *words)
    assert run([*words, "--accept", "empty"]) == 0
    assert TablewarePlanFile.read(folder / "empty" / "plan.json").steps == ()


def test_what_stands_outside_the_workspace_is_left_alone(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = _scene(folder, "edge", items=[_item("in"), _item("out", x=0.37)])
    words = ("tableware", "plan", "--scene", scene, "--source", "truth", "--out", str(folder / "partial"), "--quiet")
    assert "out: at (0.370, 0.000) m, hangs over the edge" in _refused(capsys, 4, *words)
    planned = TablewarePlanFile.read(folder / "partial" / "plan.json")
    assert [item.name for item in planned.items] == ["in"] and planned.refused[0].reason == "outside_workspace"


@pytest.mark.parametrize(
    ("items", "said"),
    [
        ([_item("a", "teapot")], "kind"),
        ([_item("a"), _item("a")], "two items are called 'a'"),
        ([_item("a") | {"on": "b"}], "stands on 'b', which is not there"),
        ([_item("a") | {"on": "b"}, _item("b") | {"on": "a"}], "stands on itself"),
        ([_item(f"a{n}") for n in range(61)], "at most 60"),
    ],
)
def test_scenes_that_cannot_be_are_refused(
    tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str], items: list[object], said: str
) -> None:
    root = tmp_path / "wrong"
    root.mkdir()
    data = json.loads((folder / "scene" / "scene.json").read_text()) | {"items": items}
    (root / "scene.json").write_text(json.dumps(data))
    scene = str(seal(root, "tableware_scene"))
    words = ("tableware", "simulate", "--scene", scene, "--out", str(tmp_path / "x"), "--quiet")
    assert said in _refused(capsys, 3, *words)


def test_a_damaged_plan_is_refused(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = tmp_path / "plan"
    root.mkdir()
    (root / "plan.json").write_text('{"policy": "ours", "steps": [')
    plan, scene = str(seal(root, "tableware_plan")), str(folder / "scene")
    words = ("tableware", "simulate", "--scene", scene, "--plan", plan, "--out", str(tmp_path / "x"), "--quiet")
    assert "plan.json" in _refused(capsys, 3, *words)


def test_a_plan_of_another_table_is_refused(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    here = _scene(folder, "here", items=[_item("a", "bowl")])
    plan = str(tmp_path / "plan")
    assert run(["tableware", "plan", "--scene", here, "--source", "truth", "--out", plan, "--quiet"]) == 0
    words = ("tableware", "simulate", "--scene", str(folder / "scene"), "--plan", plan, "--out", str(tmp_path / "x"))
    assert "none of its 1 items stands where" in _refused(capsys, 3, *words)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["plan", "--policy", "greedy", "--scene", "x"], "greedy"),
        (["plan"], "nothing to plan from"),
        (["plan", "--scene", "x", "--detections", "y"], "give one of them"),
        (["evaluate", "--policies", "best"], "there is no policy 'best'"),
        (["simulate", "--scene", "x", "--simulator", "physics", "--delay", "3"], "--delay"),
        (["scene", "--tier", "tier9"], "tier9"),
        (["plan", "--scene", "x", "--pull-seconds", "-1"], "pull"),
    ],
)
def test_wrong_options_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert said in _refused(capsys, 2, "tableware", *words, "--out", str(tmp_path / "x"), "--quiet")
