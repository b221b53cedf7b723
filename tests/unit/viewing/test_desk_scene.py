"""The desk of graphs and CAD scenes: the lines that the commands write, and what is shown as the edits leave it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from scenewright.cli.main import run as scenewright
from scenewright.cli.viewing.desk.desk import Desk
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.stages.edit.edits_file import read_edits

from tests.browser import WEBGL, browser, needs_browser
from tests.unit.edit.scenes import scene_room
from tests.unit.viewing.test_desk import THINGS, asked, fill, fresh, look_at, opened, served, settled, until


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return scene_room(tmp_path_factory.mktemp("room"))


def by_page(path: Path, file: Path, *edits: dict[str, Any]) -> dict[str, Any]:
    """Ask for edits as a page does; return what the server says at last."""
    told: dict[str, Any] = {}
    with served(Desk(path, file)) as server:
        for edit in edits:
            status, told = asked(server, "do", {"edit": edit, "by": "anna", "note": "so", **fresh(server)})
            assert status == 200, told
        assert asked(server, "")[0] == 200
    return told


def plain(file: Path) -> list[dict[str, Any]]:
    return [edit.model_dump(exclude={"when"}) for edit in read_edits(file).edits]


def test_a_graph_is_put_right_from_the_page_as_by_commands(room: dict[str, Path], tmp_path: Path) -> None:
    page, command = tmp_path / "page.toml", tmp_path / "command.toml"
    told = by_page(
        room["graph"],
        page,
        {"what": "support", "of": "box_4", "on": "floor_1", "relation": "supports"},
        {"what": "support", "of": "table_2", "on": "nothing"},
        {"what": "mark", "of": "cabinet_5", "as": "fixed"},
    )
    assert [row["status"] for row in told["rows"]] == ["applied"] * 3
    where = ["--contact-graph", str(room["graph"]), "--by", "anna", "--note", "so"]
    for words in (["support", "box_4", "--on", "floor_1"], ["support", "table_2", "--on", "nothing"]):
        assert scenewright(["edit", words[0], str(command), *words[1:], *where]) == 0
    assert scenewright(["edit", "mark", str(command), "cabinet_5", "fixed", *where]) == 0
    assert plain(page) == plain(command)


def test_a_scene_is_put_right_from_the_page_as_by_commands(room: dict[str, Path], tmp_path: Path) -> None:
    page, command = tmp_path / "page.toml", tmp_path / "command.toml"
    scene = CadScene(room["cad"])
    fridge = scene.graph.node("fridge_3")
    assert fridge.model_id == "fridge_tall" and fridge.joints
    (joint,) = list(fridge.joints)[:1]
    part = {"center": [-0.8, -0.8, 0.6], "size": [0.5, 0.3, 0.5], "yaw_degrees": 0}
    told = by_page(
        room["cad"],
        page,
        {"what": "joint", "of": "fridge_3", "at": joint, "upper": 1.0},
        {"what": "no_joint", "of": "fridge_3", "at": joint},
        {"what": "model", "of": "box_4", "model": "none"},
        {"what": "move", "of": "table_2", "to": [-0.4, 0.6, 0.37], "turn_degrees": 30, "carried": True},
        {"what": "move", "of": "cabinet_5", "to": [-0.7, -1.0, 0.45], "turn_degrees": 10},
        {"what": "mark", "of": "cabinet_5", "as": "fixed"},
        {
            "what": "new_joint", "of": "cabinet_5", "part": part, "type": "revolute", "axis": [0, 0, 1],
            "origin": [-1.1, -0.8, 0.5], "upper": 1.5,
        },
    )  # fmt: skip
    assert [row["status"] for row in told["rows"]] == ["applied"] * 7, told["rows"]
    where = ["--cad-scene", str(room["cad"]), "--by", "anna", "--note", "so"]
    box = ["--center", "-0.8", "-0.8", "0.6", "--size", "0.5", "0.3", "0.5"]
    for words in (
        ["joint", "fridge_3", joint, "--upper", "1.0"],
        ["no-joint", "fridge_3", joint],
        ["model", "box_4", "none"],
    ):
        assert scenewright(["edit", words[0], str(command), *words[1:], *where]) == 0
    lines = plain(page)
    assert lines[:3] == plain(command)
    # Of things that were not touched before, the lines are the same too; the others mean them as they are then.
    first = ["move", str(command), "table_2", "--to", "-0.4", "0.6", "0.37", "--turn", "30", "--carried", *where]
    assert scenewright(["edit", *first]) == 0
    second = ["move", str(command), "cabinet_5", "--to", "-0.7", "-1.0", "0.45", "--turn", "10", *where]
    assert scenewright(["edit", *second]) == 0
    assert lines[3:5] == plain(command)[3:]
    third = ["new-joint", str(command), "cabinet_5", "--type", "revolute", *box, "--axis", "0", "0", "1"]
    assert scenewright(["edit", *third, "--origin", "-1.1", "-0.8", "0.5", "--upper", "1.5", *where]) == 0
    same = ("part", "type", "axis", "origin", "lower", "upper", "handle")
    assert [lines[6][key] for key in same] == [plain(command)[5][key] for key in same]
    # What the page showed is what the step makes.
    out = tmp_path / "edited"
    apply = ["edit", "scene", "--cad-scene", str(room["cad"]), "--edits", str(page), "--out", str(out)]
    assert scenewright([*apply, "--panoptic-map", str(room["map"])]) == 0
    made = CadScene(out)
    assert made.edits is not None and [one.status for one in made.edits.edits] == ["applied"] * 7
    with served(Desk(out, page)) as server:  # of an edited scene: as it was before the same file
        assert [row["status"] for row in asked(server, "now")[1]["rows"]] == ["applied"] * 7


def test_what_is_none_is_refused(room: dict[str, Path], tmp_path: Path) -> None:
    with served(Desk(room["cad"], tmp_path / "edits.toml")) as server:
        for edit, words in (
            ({"what": "joint", "of": "fridge_3", "at": "</script>"}, "no joint"),
            ({"what": "joint", "of": "cabinet_5", "at": "door"}, "no model"),
            ({"what": "move", "of": "table_2", "to": [0, "a", 0]}, "not a place"),
            ({"what": "move", "of": "table_2", "to": [0, 0, 0], "turn_degrees": "x"}, "not a number"),
            ({"what": "move", "of": "unicorn_1"}, "no thing"),
            ({"what": "model", "of": "table_2", "model": "../../etc"}, "model"),
            ({"what": "support", "of": "box_4", "on": {"class": "cup"}}, "no thing"),
        ):
            status, told = asked(server, "do", {"edit": edit, **fresh(server)})
            assert status == 422 and words in told["error"] and "\n" not in told["error"], (edit, told)
    assert not (tmp_path / "edits.toml").exists()


def test_the_map_behind_a_scene_is_put_right_from_its_page(room: dict[str, Path], tmp_path: Path) -> None:
    """One page, one file: what is of the map is for `edit map`, what is of the scene for `edit scene`."""
    file = tmp_path / "edits.toml"
    told = by_page(
        room["cad"],
        file,
        {"what": "rename", "of": "cabinet_5", "class": "dishwasher"},
        {"what": "support", "of": "box_4", "on": "floor_1"},
        {"what": "mark", "of": "table_2", "as": "movable"},
    )
    assert [(row["number"], row["status"]) for row in told["rows"]] == [(k, "applied") for k in (1, 2, 3)]
    for verb, role, name in (("map", "panoptic-map", "map"), ("graph", "contact-graph", "graph")):
        words = [f"--{role}", str(room[name]), "--edits", str(file), "--out", str(tmp_path / name)]
        assert scenewright(["edit", verb, *words]) == 0
    link = ContactGraph(tmp_path / "graph").info.parent_link("box_4")
    assert link is not None and link.source == "floor_1"


@needs_browser
def test_a_scene_is_put_right_by_clicking(room: dict[str, Path], tmp_path: Path) -> None:
    file = tmp_path / "edits.toml"
    with served(Desk(room["cad"], file)) as server, browser(*WEBGL) as window:
        opened(window, server.page_address)
        node = CadScene(room["cad"]).graph.node("cabinet_5")
        assert node.box is not None
        x, y, z = node.box.center
        # Move: click the thing, then where it is to stand.
        window.press("[data-kind=move]")
        look_at(window, (x, y, z + node.box.size[2] / 2), 1.2)
        window.click_at("#picture", 0, 0)
        until(window, "return document.querySelector('#desk .thing')?.textContent", "cabinet_5 ×")
        window.press("#desk [data-field=to] .slot")
        look_at(window, (0.6, -0.9, 0.0), 1.2)
        window.click_at("#picture", 0, 0)
        until(window, "return document.querySelector('#desk [data-field=to] .wanted') === null", True)
        fill(window, "#desk [data-field=turn_degrees]", "45")
        window.press("#desk [type=submit]")
        until(window, THINGS, ["applied"])
        settled(window)
        # A joint that is none: by its name.
        window.press("[data-kind=no_joint]")
        window.run("window.scenewright.choose('fridge_3', true)")
        until(window, "return document.querySelectorAll('#desk [data-field=at] option').length > 1", True)
        window.run(
            "const s = document.querySelector('#desk [data-field=at]');"
            "s.selectedIndex = 1; s.dispatchEvent(new Event('change'))"
        )
        window.press("#desk [type=submit]")
        until(window, THINGS, ["applied"] * 2)
        settled(window)
        # No model: a word.
        window.press("[data-kind=model]")
        window.run("window.scenewright.choose('box_4', false)")
        assert window.run("return document.querySelector('#desk [type=submit]').disabled")
        window.run("[...document.querySelectorAll('#desk [data-field=model] button')][0].click()")
        window.press("#desk [type=submit]")
        until(window, THINGS, ["applied"] * 3)
        settled(window)
        assert window.complaints() == []
    moved, joint, model = read_edits(file).edits
    said = [(edit.what, edit.model_dump()["of"]["class_name"]) for edit in (moved, joint, model)]
    assert said == [("move", "cabinet"), ("no_joint", "fridge"), ("model", "box")]
    place = moved.model_dump()["to"]
    assert abs(place[0] - 0.6) < 0.03 and abs(place[1] + 0.9) < 0.03 and abs(place[2] - node.box.size[2] / 2) < 0.03
    assert moved.model_dump()["turn_degrees"] == 45
