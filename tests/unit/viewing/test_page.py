"""Pages: what viewers draw, in a file for any browser; nodes, sliders, time and keys in a real one."""

from __future__ import annotations

import base64
import gzip
import json
import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenewright.cli.viewing.view import view_artifact
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.schemas.interactive_scene import SettledBody, SettleFile
from scenewright.stages.kit.formats.scene_bundle import write_scene_bundle
from scenewright.stages.kit.geometry.boxes import box_from_bounds
from scenewright.stages.kit.viewing.canvas import JointedLink, Trust
from scenewright.stages.kit.viewing.page import library, page_canvas
from scenewright.stages.kit.viewing.page.library import three_js
from scenewright.stages.kit.viewing.page.packing import STEPS
from scenewright.stages.kit.viewing.page.page_canvas import PageCanvas

from tests.browser import WEBGL, Browser, browser, needs_browser
from tests.unit.urdf.small_room import graph_of, layout
from tests.unit.viewing.artifacts import seal

HOSTILE = "</script><script>document.title='taken'</script><b>\"'&" + "x" * 10_000


def document_of(page: Path) -> dict:
    found = re.search(r'<script id="document"[^>]*>(.*?)</script>', page.read_text(), re.DOTALL)
    assert found
    return json.loads(found[1])


def block_of(page: Path) -> bytes:
    found = re.search(r'<script id="block"[^>]*>(.*?)</script>', page.read_text(), re.DOTALL)
    assert found
    return gzip.decompress(base64.b64decode(found[1]))


def small_page(path: Path, name: str = "small") -> Path:
    """A table with a cup on it that slides for two seconds, and a cabinet with a door and a drawer in it."""
    with PageCanvas(name, path) as canvas:
        canvas.view("all")
        canvas.view("without the table", "table_1")
        table = trimesh.creation.box((1.0, 1.0, 0.1))
        canvas.mesh("table_1", table, np.tile(np.array([200, 150, 90], np.uint8), (8, 1)))
        canvas.mesh("cup_2", trimesh.creation.box((0.2, 0.2, 0.2)))
        canvas.boxes(
            "boxes",
            [
                box_from_bounds((-0.5, -0.5, -0.05), (0.5, 0.5, 0.05)),
                box_from_bounds((-0.1, -0.1, 0.05), (0.1, 0.1, 0.25)),
            ],
            ["table 1", "cup 2"],
            [(1, 0, 0), (0, 1, 0)],
        )
        label = ["table_1 supports cup_2: plane 0, gap 2 mm, overlap 95 %"]
        canvas.line("edges/supports", [np.array([[0, 0, 0], [0, 0, 0.15]])], [(0, 0, 1)], labels=label)
        canvas.graph(["scene", "table_1", "cup_2"], [(0, 0, 0)] * 3, [("scene", "table_1"), ("table_1", "cup_2")])
        canvas.document("plan", f"**failed**: nothing was held\n| a | b |\n|---|---|\n| {name} | 2 |")
        for link in ("body", "door"):
            canvas.mesh(f"cabinet/{link}", trimesh.creation.box((0.3, 0.02, 0.3)))
        hinge = np.eye(4)
        hinge[:3, 3] = (1.0, 0.0, 0.2)
        canvas.joints(
            [
                JointedLink("cabinet/body", "", np.eye(4)),
                JointedLink("cabinet/door", "cabinet/body", hinge, "turning", name="hinge", lower=0.0, upper=1.5),
            ]
        )
        canvas.trust({"cup_2": Trust(0.2, ("no mask gave it a name",)), "table_1": Trust(0.9)})
        canvas.moment(10.0, "1. push cup_2")
        canvas.moment(11.5, f"it fell: {name}", bad=True)
        for moment in (0.0, 1.0, 2.0):
            canvas.time(10.0 + moment)
            pose = np.eye(4)
            pose[:3, 3] = (0.2 * moment, 0, 0.15)
            canvas.transform("cup_2", pose)
    return path


def test_a_page_holds_what_was_drawn_and_is_the_same_again(tmp_path: Path) -> None:
    page = small_page(tmp_path / "a.html")
    assert page.read_bytes() == small_page(tmp_path / "b.html").read_bytes()
    drawn, block = document_of(page), block_of(page)
    (table,) = [item for item in drawn["meshes"] if item["path"] == "table_1"]
    first, count = table["at"]
    steps = np.frombuffer(block, "<u2", count, first).reshape(-1, 3)
    placed = np.array(table["low"]) + steps * np.array(table["step"])
    assert np.allclose(np.unique(np.abs(placed), axis=0), [[0.5, 0.5, 0.05]], atol=1.0 / STEPS)
    faces = np.frombuffer(block, "<u4", table["faces"][1], table["faces"][0]).reshape(-1, 3)
    assert faces.shape == (12, 3) and faces.max() == 7
    # The door and the body have one shape, held once.
    body, door = (next(i for i in drawn["meshes"] if i["path"] == f"cabinet/{name}") for name in ("body", "door"))
    assert body["at"] == door["at"] and body["faces"] == door["faces"]


def test_large_scenes_are_thinned_and_what_is_left_out_is_said(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(page_canvas, "MOST_VERTICES", 5000)
    sphere = trimesh.creation.icosphere(5)
    with PageCanvas("large", tmp_path / "large.html") as canvas:
        canvas.mesh("ball", sphere)
        canvas.mesh("ball again", sphere, np.full((len(sphere.vertices), 3), 9, np.uint8))
        canvas.depth("camera/depth", np.ones((4, 4)))
    drawn = document_of(tmp_path / "large.html")
    assert drawn["left_out"] == ["depth images", "detail below 80 mm"]
    assert len({tuple(item["at"]) for item in drawn["meshes"]}) == 1 and drawn["meshes"][0]["at"][1] <= 3 * 5000
    monkeypatch.setattr(page_canvas, "LARGEST_PAGE", 1000)
    with pytest.raises(BadInput, match="MB"):
        small_page(tmp_path / "too_large.html")
    assert not (tmp_path / "too_large.html").exists() and len(list(tmp_path.iterdir())) == 1


def test_three_js_is_what_trimesh_ships(monkeypatch) -> None:
    assert 400_000 < len(three_js()) < 2_000_000 and "WebGLRenderer" in three_js()
    monkeypatch.setattr(library, "END", "another library")
    with pytest.raises(MissingDependency):
        three_js()


def opened(window: Browser, page: Path, more: str = "") -> None:
    window.open("about:blank")
    window.open(page.as_uri() + more)
    deadline = time.monotonic() + 20
    while not window.run("return document.body.dataset.ready && document.body.dataset.drawn"):
        assert time.monotonic() < deadline, window.run("return document.body.dataset.error")
        time.sleep(0.05)


@needs_browser
def test_a_page_in_a_browser(tmp_path: Path) -> None:
    page = small_page(tmp_path / "small.html", HOSTILE)
    with browser(*WEBGL) as window:
        opened(window, page)
        assert window.run("return document.title").startswith("</script>") and window.text("#name").startswith("</scr")
        # Nodes: each is there, hovering marks it, an edge tells its numbers.
        names = window.run("return [...document.querySelectorAll('.node .name')].map((node) => node.textContent)")
        assert names == ["scene", "table_1", "cup_2"]
        window.press(".node .edge")
        assert "gap 2 mm" in window.text("#relations")
        window.run("[...document.querySelectorAll('.node .name')][2].click()")
        assert window.text(".node .chosen") == "cup_2"
        # Layers and views, by mouse and by key.
        off = "return JSON.parse(decodeURIComponent(location.hash.slice(1))).off"
        window.run("document.getElementById('picture').focus()")
        window.keys("2")
        time.sleep(0.5)
        assert window.run(off) == ["table_1"]
        assert not window.run("return document.querySelector('[data-layer=table_1] input').checked")
        # What to trust, the least first, by its key.
        window.keys("t")
        rows = "return [...document.querySelectorAll('#trusted .node')].map((row) => row.textContent)"
        assert window.run(rows) == ["cup_2no mask gave it a name", "table_1nothing speaks against it"]
        assert window.run("return document.getElementById('doubts').open && window.scenewright.state.trust")
        # A joint by its slider.
        slide = "const s = document.querySelector('[data-joint=hinge] input'); s.value = 1.0;"
        window.run(slide + "s.dispatchEvent(new Event('input'))")
        assert window.text("[data-joint=hinge] output") == "57°"
        # Time by its bar, and played by a key.
        window.run("const m = document.getElementById('moment'); m.value = 11; m.dispatchEvent(new Event('input'))")
        assert window.text("#clock") == "1.00 s" and window.text("#happening") == "1. push cup_2"
        window.press(".tick.bad")
        assert window.text("#clock") == "1.50 s" and window.text("#happening").startswith("it fell: </script>")
        window.run("document.getElementById('picture').focus()")
        window.keys(" ")
        window.wait_for("#clock", "2.00 s")
        # A click on the picture says what is there.
        window.press("#fit")
        window.click_at("#picture", 0, 0)
        window.wait_for("#said", " m")
        # Its address opens the same view again.
        window.press("#link")
        address = window.run("return location.hash")
        opened(window, page, address)
        assert window.text("#clock") == "2.00 s" and window.run(off) == ["table_1"]
        assert window.text("[data-joint=hinge] output") == "57°"
        opened(window, page, "#%7Bnonsense")
        assert window.complaints() == []
    with browser("--disable-gpu", "--disable-3d-apis") as window:
        opened(window, page)
        assert "no WebGL" in window.text("#said")
        colors = (
            "const c = document.getElementById('picture'), d = c.getContext('2d').getImageData(0, 0, c.width, c.height)"
        )
        assert window.run(f"{colors}.data; return new Set(d).size") > 5
        window.press(".node .edge")
        assert "gap 2 mm" in window.text("#relations") and window.complaints() == []


def scene_of_boxes(run: Path, count: int) -> Path:
    """An interactive scene of a floor and boxes on it, that all move while they settle."""
    bodies = [layout("floor_1", "floor", (3.6, 3.0, 0.0), (9.0, 8.0, 0.02))]
    for k in range(2, count + 1):
        box = layout(f"cup_{k}", "cup", (0.3 * (k % 25), 0.3 * (k // 25), 0.06), (0.1, 0.1, 0.1))
        bodies.append(replace(box, parent="floor_1", movable=True))
    root = run / "interactive_scene"
    root.mkdir()
    write_scene_bundle(root, bodies, graph_of(bodies))
    times = tuple(round(0.05 * k, 2) for k in range(61))  # what `urdf` watches
    moved = tuple(
        SettledBody(
            name=body.name, moved=0.1, turned=0.0, poses=tuple((0, 0, 0.001 * k, 0, 0, 0, 1) for k in range(61))
        )
        for body in bodies[1:]
    )
    SettleFile(times=times, bodies=moved, verdict="ok", reason="stays").write(root / "settle.json")
    return seal(root, "interactive_scene")


@needs_browser
def test_a_scene_of_five_hundred_bodies(tmp_path: Path) -> None:
    page = tmp_path / "scene.html"
    view_artifact(scene_of_boxes(tmp_path, 500), page)
    assert page.stat().st_size < page_canvas.LARGEST_PAGE
    with browser(*WEBGL) as window:
        opened(window, page)
        nodes = "[...document.querySelectorAll('.node .name')]"
        assert window.run(f"return {nodes}.length") == 501  # and the scene
        window.run(f"{nodes}.find((node) => node.textContent === 'cup_321').click()")
        assert window.text(".node .chosen") == "cup_321" and "supports cup_321" in window.text("#relations")
        window.run("const m = document.getElementById('moment'); m.value = 2; m.dispatchEvent(new Event('input'))")
        assert window.text("#clock") == "2.00 s" and window.complaints() == []


@needs_browser
def test_what_nothing_is_drawn_of_is_a_page_to_read(tmp_path: Path) -> None:
    with PageCanvas("words", tmp_path / "words.html") as canvas:
        canvas.document("figures", "first\n```\n| a  b\n```")
    with browser(*WEBGL) as window:
        opened(window, tmp_path / "words.html")
        assert "first" in window.text(".document") and window.text(".document pre") == "| a  b"
        assert window.run("return document.getElementById('picture').clientHeight") == 0
        assert window.complaints() == []


def test_at_first_everything_is_in_sight_where_it_is_placed(tmp_path: Path) -> None:
    with PageCanvas("placed", tmp_path / "placed.html") as canvas:
        for name, x in (("left", -2.0), ("right", 3.0)):
            canvas.mesh(f"{name}/cube", trimesh.creation.box((1, 1, 1)))
            canvas.transform(name, np.array([[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]))
        canvas.time(1.0)
        canvas.transform("left", np.diag([1.0, 1, 1, 1]) * 1e3)  # where it goes later does not count
    low, high = document_of(tmp_path / "placed.html")["bounds"]
    margin = page_canvas.MARGIN * np.array([6, 1, 1])
    assert np.allclose(low, [-2.5, -0.5, -0.5] - margin) and np.allclose(high, [3.5, 0.5, 0.5] + margin)
