"""A person cuts by clicking: the plane of two clicks, the file, the page in a real browser, who is turned away."""

from __future__ import annotations

import contextlib
import http.client
import json
import threading
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from scenewright.cli.main import run
from scenewright.schemas.cutting_demonstrations import CuttingDemonstrationsFile, CuttingRecording
from scenewright.schemas.cutting_model import CuttingModelFile
from scenewright.schemas.errors import BadInput
from scenewright.stages.cutting.ours.grammar import learn
from scenewright.stages.cutting.recording.panels import HEIGHT, WIDTH, NoCut
from scenewright.stages.cutting.recording.server import RecordingServer
from scenewright.stages.cutting.recording.session import Session, object_of, read_recording

from tests.browser import browser, needs_browser

MIDDLE = 0.5 * WIDTH


def across(x: float, panel: int = 0) -> np.ndarray:
    """Two clicks above and below a picture's pieces, so many pixels from its left edge."""
    return np.array([[panel * WIDTH + x, 5.0], [panel * WIDTH + x, HEIGHT - 5.0]])


@contextlib.contextmanager
def serving(session: Session) -> Iterator[RecordingServer]:
    server = RecordingServer(session, 0)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def test_two_clicks_are_the_plane_of_their_line_and_the_line_of_sight(tmp_path: Path) -> None:
    session = Session(tmp_path / "cuts.json", "cheese", 3)
    body = session.trial.objects[0]
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    for panel, axis, flat in ((0, 0, 2), (1, 0, 1), (2, 1, 0)):
        piece, plane = session.shown.plane(across(MIDDLE - 0.5, panel))
        assert piece == 0 and abs(plane.normal[axis]) > 0.999 and abs(plane.normal[flat]) < 0.01
        assert abs(plane.height(0.5 * (low + high)[None])[0]) < 2e-3 * (high - low).max()


def test_too_few_pieces_to_learn_from_are_counted(tmp_path: Path) -> None:
    session = Session(tmp_path / "cuts.json", "carrot", 5)
    session.cut(across(MIDDLE))
    with pytest.raises(ValueError, match="3 pieces, whole ones too; at least 4"):
        learn([session.trial], seed=0)


def test_every_cut_is_kept_at_once_and_a_recording_is_gone_on_with(tmp_path: Path) -> None:
    path = tmp_path / "cuts.json"
    session = Session(path, "carrot", 5)
    assert session.cut(across(MIDDLE)) == "piece 0 became 1, 2"
    with pytest.raises(NoCut, match="misses every piece"):
        session.cut(np.array([[5.0, 5.0], [5.0, 60.0]]))
    session.cut(across(0.75 * WIDTH))
    assert session.undo().startswith("piece")
    assert len(CuttingRecording.read(path).trials[0].trial.cuts) == 1  # stopped here: nothing is lost
    again = Session(path, "carrot", 5)
    again.cut(across(MIDDLE))
    again.finish("chunks")
    trials, done = read_recording(path)
    assert [trial.trial.finished for trial in trials] == [False, True]
    assert done[1].categories == {1: "chunks", 2: "chunks"} and len(done[0].fragments) == 2
    volumes = [body.volume for body in done[0].fragments]
    assert sum(volumes) == pytest.approx(object_of("carrot", 5).volume, rel=1e-6)


@pytest.mark.parametrize(
    ("points", "said"),
    [
        ([[100, 5], [WIDTH + 100, 300]], "two images"),
        ([[100, 100], [101, 101]], "too close"),
        ([[-5, 100], [300, 100]], "outside"),
        ([[100, 100], [3 * WIDTH + 1, 100]], "outside"),
    ],
)
def test_clicks_that_say_no_cut_are_refused(tmp_path: Path, points: list, said: str) -> None:
    session = Session(tmp_path / "cuts.json", "carrot", 0)
    with pytest.raises(NoCut, match=said):
        session.cut(np.array(points, dtype=float))
    with pytest.raises(NoCut, match="nothing was cut"):
        session.finish("slices")
    assert not (tmp_path / "cuts.json").exists()


def test_slivers_are_refused_and_the_file_stays(tmp_path: Path) -> None:
    session = Session(tmp_path / "cuts.json", "sausage", 0)
    session.cut(across(MIDDLE))
    before = (tmp_path / "cuts.json").read_bytes()
    seen = np.flatnonzero((session.shown.piece[:, :WIDTH] >= 0).any(axis=0))
    with pytest.raises(NoCut, match=r"sliver|misses"):
        session.cut(across(seen[0] + 0.6))
    assert (tmp_path / "cuts.json").read_bytes() == before


@pytest.mark.slow
def test_what_a_person_cut_is_demonstrated_and_learned_from(tmp_path: Path) -> None:
    path = tmp_path / "cuts.json"
    session = Session(path, "cucumber", 0)
    for _ in range(2):
        for share in (0.3, 0.5, 0.7):
            session.cut(across(share * WIDTH))
        session.finish("slices")
    session.cut(across(MIDDLE))  # and stopped midway
    shown, model = tmp_path / "shown", tmp_path / "model"
    quiet = ["--image-width", "300", "--quiet"]
    assert run(["cutting", "demonstrate", "--record", str(path), "--out", str(shown), *quiet]) == 0
    file = CuttingDemonstrationsFile.read(shown / "demonstrations.json")
    assert len(file.trials) == 3 and file.tilt is None and "1 not finished" in file.statement
    assert run(["cutting", "learn", "--demonstrations", str(shown), "--out", str(model), "--quiet"]) == 0
    assert CuttingModelFile.read(model / "model.json").unfinished == 1


@pytest.mark.parametrize(
    "change",
    [
        lambda trial: trial.update(food="stone"),
        lambda trial: trial["trial"].update(families=["bread"]),
        lambda trial: trial["trial"]["cuts"][0]["plane"].update(d=3.0),
        lambda trial: trial["trial"]["cuts"][0].update(piece=9),
        lambda trial: trial["trial"]["cuts"][0]["shifts"].append([0, 0, 0]),
    ],
)
@pytest.mark.slow
def test_a_recording_that_was_changed_is_refused_in_a_line(
    tmp_path: Path, change: object, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "cuts.json"
    Session(path, "carrot", 0).cut(across(MIDDLE))
    data = json.loads(path.read_text())
    change(data["trials"][0])  # type: ignore[operator]
    path.write_text(json.dumps(data))
    with pytest.raises(BadInput):
        read_recording(path)
    assert run(["cutting", "demonstrate", "--record", str(path), "--out", str(tmp_path / "x"), "--quiet"]) == 3
    assert len(capsys.readouterr().err.strip().splitlines()) == 1 and not (tmp_path / "x").exists()


def ask(server: RecordingServer, path: str, body: bytes | None, **headers: str) -> tuple[int, bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=10)
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request("GET" if body is None else "POST", path, body, named)
    reply = connection.getresponse()
    return reply.status, reply.read()


def test_only_who_knows_the_address_is_answered(tmp_path: Path) -> None:
    with serving(Session(tmp_path / "cuts.json", "carrot", 0)) as server:
        page = urlsplit(server.page_address).path
        assert not server.exposed
        status, body = ask(server, page, None)
        assert status == 200 and b"<!doctype html>" in body
        status, body = ask(server, "/", None)
        assert status == 404 and page.encode() not in body  # the address is the password
        assert ask(server, page, None, Host="evil.example")[0] == 421
        assert ask(server, f"{page}/do", b"{}")[0] == 400
        assert ask(server, f"{page}/do", b'{"do": "cut"}')[0] == 409
        assert ask(server, f"{page}/do", b'{"do": "cut", "points": [[1, 1e999], [2, 2]]}')[0] == 400
        assert ask(server, f"{page}/do", b" " * 5000)[0] == 413
        assert ask(server, f"{page}/do", b'{"do": "look"}')[0] == 200
        assert not (tmp_path / "cuts.json").exists()


@needs_browser
def test_a_person_cuts_in_a_browser(tmp_path: Path) -> None:
    path = tmp_path / "cuts.json"
    with serving(Session(path, "cucumber", 2)) as server, browser() as window:
        window.open(server.page_address)
        window.wait_for("#count", "0 cuts, 1 pieces")
        for x in (-WIDTH, -WIDTH + 60):  # from the middle of the three pictures
            window.click_at("#picture", x, -150)
            window.click_at("#picture", x, 150)
            window.wait_for("#said", "became")
        window.wait_for("#count", "2 cuts, 3 pieces")
        window.click_at("#picture", 0, -170)
        window.click_at("#picture", 100, -170)
        window.wait_for("#said", "misses every piece")
        window.press("[data-do=undo]")
        window.wait_for("#count", "1 cuts, 2 pieces")
        window.press("[data-category=chunks]")
        window.wait_for("#count", "0 cuts, 1 pieces; 1 trials kept")
        window.press("[data-do=end]")
        window.wait_for("#said", "ended")
    (trial,) = CuttingRecording.read(path).trials
    assert trial.trial.finished and set(trial.trial.categories.values()) == {"chunks"}
    assert abs(trial.trial.cuts[0].plane.normal[0]) > 0.99
