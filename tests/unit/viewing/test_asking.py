"""Words asked of a language map on its page, in a real browser; and splats through time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.cli.viewing.desk import asking
from scenewright.cli.viewing.desk.desk import Desk
from scenewright.cli.viewing.splat_view import first_seen
from scenewright.schemas.language_map import LanguageMap, LanguageMapFile, LanguageRegion
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.splat import Splat, SplatFile, SplatView
from scenewright.stages.kit.formats.trajectories import write_tum
from scenewright.stages.kit.geometry.boxes import minimum_box
from scenewright.stages.kit.geometry.transforms import inverse, transform_from
from scenewright.stages.kit.open_words.encoder import unit
from scenewright.stages.kit.open_words.vectors import Vectors, write_vectors
from scenewright.stages.kit.rendering.splatting.rasterizer import View
from scenewright.stages.splat.ply import write_gaussians

from tests.browser import WEBGL, browser, needs_browser
from tests.unit.open_words.stand_ins import COLORS, ColorEncoder
from tests.unit.splat.test_language import BALLS, CAMERA, gaussians, poses
from tests.unit.viewing.artifacts import make_sequence, seal
from tests.unit.viewing.test_desk import asked, served


def make_splat(run: Path) -> Splat:
    """Three coloured balls before a wall, and a camera that goes past."""
    root = run / "splat"
    root.mkdir()
    write_gaussians(root / "splat.ply", gaussians())
    write_tum(root / "trajectory.tum", np.arange(3.0), np.array(poses()))
    views = tuple(SplatView(frame=k, time=k, camera="camera", use="learned", arrived=k) for k in range(3))
    SplatFile(
        method="ours",
        gaussians=len(gaussians()),
        harmonics_degree=0,
        steps=1,
        loss=0.1,
        refined=False,
        cameras={"camera": CAMERA},
        views=views,
    ).write(root / "splat.json")
    return Splat(seal(root, "splat"))


def make_language(run: Path) -> LanguageMap:
    """The red ball, the blue one and the wall are places; vectors are colours. The green ball is none."""
    make_splat(run)
    root, made = run / "language", gaussians()
    root.mkdir()
    thing = np.minimum(np.arange(len(made)) // 500, 3)
    owner = np.array([0, -1, 1, 2], np.int32)[thing]
    colors = np.array([*(COLORS[name] for name in BALLS), (1.0, 1.0, 1.0)])
    field = np.repeat(unit(colors[thing])[:, None], 2, axis=1).astype(np.float32)
    opacities = np.full(len(made), 0.9, np.float32)
    write_vectors(root, Vectors(unit(colors[[0, 2, 3]]).astype(np.float32), made.means, opacities, owner[None], field))
    boxes = [minimum_box(made.means[owner == k].astype(float)) for k in range(3)]
    LanguageMapFile(
        source="splat",
        encoder=ColorEncoder.label,
        width=3,
        sizes=(0.1, 0.4),
        gaussians=len(made),
        steps=1,
        loss=0.1,
        regions=tuple(LanguageRegion(box=box, looks=1) for box in boxes),
    ).write(root / "language.json")
    return LanguageMap(seal(root, "language_map", splat=run / "splat"))


@pytest.fixture
def colors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(asking, "open_encoder", lambda *_: ColorEncoder())


def test_gaussians_are_there_from_the_picture_on_that_first_shows_them() -> None:
    narrow = Camera(width=40, height=120, fx=120.0, fy=120.0, cx=19.5, cy=59.5)
    views = [View(narrow, inverse(transform_from(np.eye(3), np.array([x, 0.0, 0.0])))) for x in (-0.7, 0.7)]
    first = first_seen(gaussians(), views)
    assert set(first[:500]) <= {0} and np.mean(first[1000:1500] == 1) > 0.4  # the far half is hidden: no view shows it
    behind = first_seen(gaussians().taken(np.zeros(len(gaussians()), bool)), views)
    assert behind.shape == (0,)


@pytest.mark.usefixtures("colors")
def test_a_page_is_told_where_words_fit_and_refused_what_asks_for_nothing(tmp_path: Path) -> None:
    with served(Desk(make_language(tmp_path).root, None)) as server:
        status, told = asked(server, "ask", {"text": "red"})
        assert status == 200 and told["answers"][0]["probability"] > 0.5 and not told["calibrated"]
        assert np.allclose(told["answers"][0]["center"], BALLS["red"], atol=0.05)
        assert not told["unknown"] and not asked(server, "ask", {"text": "green"})[1]["unknown"]
        nowhere = asked(server, "ask", {"text": "guitar"})[1]
        assert nowhere["unknown"] == (not nowhere["answers"]) and nowhere["unread"] == ["guitar"]
        assert asked(server, "ask", {"text": " ?! "})[0] == 403
        assert asked(server, "ask", {"text": "x" * 5000})[0] in (400, 403)
        assert asked(server, "ask", {"words": "red"})[0] == 400
        assert asked(server, "ask", {"text": "red"}, Content_Type="text/plain")[0] == 415


def test_the_map_of_another_encoder_and_what_is_no_language_map_say_so(tmp_path: Path) -> None:
    with served(Desk(make_language(tmp_path).root, None)) as server:
        status, told = asked(server, "ask", {"text": "red"})
        assert status == 403 and "colours" in told["error"] and "splat query" in told["error"]
    sequence = Sequence(make_sequence(tmp_path))
    with served(Desk(sequence.root, None)) as server:
        assert "language map" in asked(server, "ask", {"text": "red"})[1]["error"]


@needs_browser
@pytest.mark.usefixtures("colors")
def test_a_word_shows_heat_and_boxes_and_time_brings_the_gaussians(tmp_path: Path) -> None:
    with served(Desk(make_language(tmp_path).root, None)) as server, browser(*WEBGL) as window:
        window.open(server.page_address)
        window.wait_for("#name", "language_map")
        assert window.run("return document.body.dataset.ready") == "yes"
        # Through time: the far ball is not there from the first picture on, and all are in the end.
        count = "return window.scenewright.scene.children.filter((o) => o.type === 'Points' && o.visible).length"
        window.run(
            "const bar = document.getElementById('moment'); bar.value = arguments[0]; "
            "bar.dispatchEvent(new Event('input'))",
            0,
        )
        at_first = window.run(count)
        window.run(
            "const bar = document.getElementById('moment'); bar.value = arguments[0]; "
            "bar.dispatchEvent(new Event('input'))",
            2,
        )
        assert window.run(count) >= at_first >= 1
        # A word: warm Gaussians at the red ball, a frame about it, and what it says.
        window.run("document.getElementById('words').focus()")
        window.keys("red\ue007")
        assert "of “red”" in window.wait_for("#answered", "of “red”")
        assert int(window.run("return document.body.dataset.warm")) >= 400
        assert window.run("return document.querySelectorAll('#desk li').length") >= 1
        # What was typed is shown as text, and what is not there is said.
        empty = "document.getElementById('words').value = ''; document.getElementById('words').focus()"
        window.run(empty)
        window.keys("<b>x\ue007")
        window.wait_for("#answered", "<b>x")
        window.run(empty)
        window.keys("green\ue007")
        window.wait_for("#answered", "The room has no “green”.")
        assert window.run("return document.querySelectorAll('#desk li').length") == 0
        assert not window.complaints() and not window.run("return document.body.dataset.error")
