"""The desk: edits from a page, in a real browser, and what its server refuses."""

from __future__ import annotations

import contextlib
import http.client
import json
import shutil
import threading
import time
import urllib.error
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal
from urllib.parse import urlsplit

import numpy as np
import pytest
from pydantic import Field
from scenewright.cli.edit_forms import forms_of, kinds_of
from scenewright.cli.main import run as scenewright
from scenewright.cli.viewing.desk.desk import Desk
from scenewright.cli.viewing.desk.server import DeskServer
from scenewright.schemas.edits import Anchor, AnyEdit, ClassName, Edit, MapEdit, Mark
from scenewright.schemas.errors import BadInput, MachineFailure, UsageError
from scenewright.schemas.hand_written import Point, UprightBox
from scenewright.schemas.panoptic_map import EntitiesFile, PanopticMap
from scenewright.stages.edit.edits_file import Changed, append_edits, read_edits, remove_edit, revision_of

from tests.browser import WEBGL, Browser, browser, needs_browser
from tests.panoptic_maps import box_mesh, floor_mesh, write_map
from tests.unit.edit.maps import dense, room_map
from tests.unit.viewing.artifacts import seal

HOSTILE = "</script><img src=x onerror=\"document.title='taken'\"><b>'&" + "x" * 9_000


@contextlib.contextmanager
def served(desk: Desk) -> Iterator[DeskServer]:
    with DeskServer(desk, 0) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join(10)


def asked(server: DeskServer, path: str, body: Any = None, **headers: str) -> tuple[int, Any]:
    """Ask a server as a program would; return status and answer."""
    parts = urlsplit(server.page_address)
    connection = http.client.HTTPConnection("127.0.0.1", parts.port, timeout=120)
    data = None if body is None else json.dumps(body).encode()
    sent = {"Content-Type": "application/json", **{name.replace("_", "-"): value for name, value in headers.items()}}
    connection.request("GET" if data is None else "POST", parts.path + path, data, sent)
    reply = connection.getresponse()
    text = reply.read()
    connection.close()
    return reply.status, json.loads(text) if reply.getheader("Content-Type") == "application/json" else text.decode()


def fresh(server: DeskServer) -> dict[str, str]:
    """What a page that was just loaded knows."""
    now = asked(server, "now")[1]
    return {"artifact": now["artifact"], "revision": now["revision"]}


RENAME = {"edit": {"what": "rename", "of": "cup_3", "class": "bottle"}}


def test_an_edit_from_the_page_is_the_line_that_the_command_writes(tmp_path: Path) -> None:
    seen = room_map(tmp_path / "map")
    by_page, by_command = tmp_path / "page.toml", tmp_path / "command.toml"
    box = {"center": [0.24, 0.04, 0.8], "size": [0.3, 0.3, 0.3], "yaw_degrees": 0}
    with served(Desk(seen.root, by_page)) as server:
        for edit in (
            RENAME["edit"],
            {"what": "delete", "of": "cup_4"},
            {"what": "merge", "of": ["table_2", "cabinet_5"]},
            {"what": "add", "class": "cup", "box": box, "surface": "box"},
        ):
            status, told = asked(server, "do", {"edit": edit, "by": "anna", "note": "so", **fresh(server)})
            assert status == 200, told
        assert [row["status"] for row in told["rows"]] == ["applied"] * 4
        assert told["things"] == ["floor_1", "table_2", "bottle_3", "cup_6"]
    where = ["--panoptic-map", str(seen.root), "--by", "anna", "--note", "so"]
    assert scenewright(["edit", "rename", str(by_command), "cup_3", "--class", "bottle", *where]) == 0
    assert scenewright(["edit", "delete", str(by_command), "cup_4", *where]) == 0
    assert scenewright(["edit", "merge", str(by_command), "2", "5", *where]) == 0
    numbers = ["--center", "0.24", "0.04", "0.8", "--size", "0.3", "0.3", "0.3"]
    assert scenewright(["edit", "add", str(by_command), "--class", "cup", *numbers, "--drawn", *where[2:]]) == 0
    plain = [[edit.model_dump(exclude={"when"}) for edit in read_edits(file).edits] for file in (by_page, by_command)]
    assert plain[0] == plain[1]
    out = tmp_path / "edited"
    assert (
        scenewright(["edit", "map", "--panoptic-map", str(seen.root), "--edits", str(by_page), "--out", str(out)]) == 0
    )
    names = [f"{entity.class_name}_{entity.instance}" for entity in PanopticMap(out).info.entities]
    assert names == told["things"]


def test_a_thing_is_meant_as_the_edits_before_left_it_and_undo_deletes_a_line(tmp_path: Path) -> None:
    seen, file = room_map(tmp_path / "map"), tmp_path / "edits.toml"
    with served(Desk(seen.root, file)) as server:
        asked(server, "do", {**RENAME, **fresh(server)})
        again = {"what": "rename", "of": "bottle_3", "class": "vase"}
        _, told = asked(server, "do", {"edit": again, **fresh(server)})
        assert [row["status"] for row in told["rows"]] == ["applied"] * 2 and "vase_3" in told["things"]
        # Without the first, nothing is left of the second: a conflict, and said.
        _, told = asked(server, "do", {"remove": 1, **fresh(server)})
        assert [row["status"] for row in told["rows"]] == ["conflict"] and "cup_3" in told["things"]
        _, told = asked(server, "do", {"remove": 1, **fresh(server)})
        assert told["rows"] == [] and read_edits(file).edits == ()
        assert asked(server, "do", {"remove": 1, **fresh(server)})[0] == 422
        # What an edit took away cannot be meant any more.
        asked(server, "do", {"edit": {"what": "delete", "of": "cup_3"}, **fresh(server)})
        status, told = asked(server, "do", {**RENAME, **fresh(server)})
        assert status == 422 and "not there any more" in told["error"]
    file.write_text(file.read_text().replace("{ what", "# by hand\n  { what", 1) + "\n# the end\n")
    remove_edit(file, 1, as_read=revision_of(file))
    assert read_edits(file).edits == () and "# by hand" in file.read_text() and "# the end" in file.read_text()


def test_lines_about_the_graph_are_left_alone_and_counted(tmp_path: Path) -> None:
    seen, file = room_map(tmp_path / "map"), tmp_path / "edits.toml"
    box = UprightBox(center=(0.0, 0.0, 0.8), size=(0.1, 0.1, 0.1), yaw_degrees=0.0)
    anchor = Anchor.model_validate({"class": "cup", "box": box, "point": (0.0, 0.0, 0.8)})
    append_edits(file, [Mark.model_validate({"what": "mark", "of": anchor, "as": "fixed"})])
    with served(Desk(seen.root, file)) as server:
        assert asked(server, "do", {**RENAME, **fresh(server)})[0] == 200
        _, told = asked(server, "do", {"edit": {"what": "delete", "of": "cup_4"}, **fresh(server)})
        assert [row["number"] for row in told["rows"]] == [2, 3]
        assert asked(server, "do", {"remove": 2, **fresh(server)})[0] == 200
    assert [edit.what for edit in read_edits(file).edits] == ["mark", "delete"]


def test_two_editors_at_once_lose_nothing(tmp_path: Path) -> None:
    seen, file = room_map(tmp_path / "map"), tmp_path / "edits.toml"
    with served(Desk(seen.root, file)) as first, served(Desk(seen.root, file)) as second:
        known = fresh(second)
        assert asked(first, "do", {**RENAME, **fresh(first)})[0] == 200
        before = file.read_bytes()
        status, told = asked(second, "do", {"edit": {"what": "delete", "of": "cup_4"}, **known})
        assert status == 409 and "somebody else" in told["error"] and file.read_bytes() == before
        assert asked(second, "do", {"remove": 1, **known})[0] == 409 and file.read_bytes() == before
        now = asked(second, "now")[1]
        assert [row["what"] for row in now["rows"]] == ["rename"] and "bottle_3" in now["things"]
        assert asked(second, "do", {"edit": {"what": "delete", "of": "cup_4"}, **fresh(second)})[0] == 200
    assert [edit.what for edit in read_edits(file).edits] == ["rename", "delete"]
    with pytest.raises(Changed):
        append_edits(file, [], as_read="another")
    # Twenty at once, each trying again until it is taken.
    with served(Desk(seen.root, file)) as server:

        def insist() -> None:
            while True:
                if (
                    asked(
                        server, "do", {"edit": {"what": "rename", "of": "table_2", "class": "desk"}, **fresh(server)}
                    )[0]
                    == 200
                ):
                    return

        threads = [threading.Thread(target=insist) for _ in range(20)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(60)
    assert len(read_edits(file).edits) == 22


def test_who_may_ask(tmp_path: Path) -> None:
    seen, file = room_map(tmp_path / "map"), tmp_path / "edits.toml"
    with served(Desk(seen.root, file)) as server:
        port = urlsplit(server.page_address).port
        body = {**RENAME, **fresh(server)}
        # Without the token: nothing, and no word of what there is.
        for method, path in (("GET", "/"), ("GET", "/now"), ("POST", "/do"), ("POST", "/x/do")):
            connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
            connection.request(method, path, b"{}" if method == "POST" else None)
            assert connection.getresponse().status == 404
        for headers in (
            {"Origin": "http://example.org"},
            {"Origin": "null"},
            {"Origin": f"http://127.0.0.1:{port + 1}"},
            {"Origin": f"https://127.0.0.1:{port}"},
            {"Sec_Fetch_Site": "cross-site"},
        ):
            assert asked(server, "do", body, **headers)[0] == 403, headers
            assert asked(server, "now", None, **headers)[0] == 403, headers
        for host in (f"example.org:{port}", "rebound.example", f"127.0.0.1.example.org:{port}"):
            assert asked(server, "do", body, Host=host)[0] == 421
        assert asked(server, "do", body, Content_Type="text/plain")[0] == 415
        assert asked(server, "do", {"edit": 3})[0] == 400 and asked(server, "do", [])[0] == 400
        assert asked(server, "do", {"edit": {}, **fresh(server), "note": "x" * 300_000})[0] == 413
        assert not file.exists()
        assert asked(server, "do", body, Origin=f"http://127.0.0.1:{port}", Sec_Fetch_Site="same-origin")[0] == 200
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
        connection.request("GET", urlsplit(server.page_address).path)
        reply = connection.getresponse()
        assert reply.getheader("X-Frame-Options") == "DENY" and reply.getheader("Referrer-Policy") == "no-referrer"
        assert reply.getheader("Access-Control-Allow-Origin") is None
        with pytest.raises(MachineFailure, match="in use"):
            DeskServer(Desk(seen.root, None), port)
        assert scenewright(["view", str(seen.root), "--port", str(port)]) == 6


def test_edits_that_are_none_are_refused_in_one_line(tmp_path: Path) -> None:
    seen, file = room_map(tmp_path / "map"), tmp_path / "edits.toml"
    with served(Desk(seen.root, file)) as server:
        for edit, words in (
            ({"what": "explode"}, "no edit 'explode'"),
            ({"what": "rename", "of": "unicorn_9", "class": "cup"}, "no thing 'unicorn_9'"),
            ({"what": "rename", "of": HOSTILE, "class": "cup"}, "no thing"),
            ({"what": "rename", "of": "cup_3", "class": HOSTILE}, "vocabulary"),
            ({"what": "merge", "of": ["cup_3"]}, "at least 2"),
            ({"what": "merge", "of": "cup_3"}, "of"),
            ({"what": "add", "class": "cup", "box": {"center": [0, 0, 1e99], "size": [1, 1, 1]}}, "box"),
            ({"what": "rename", "of": {"class": "cup"}, "class": "cup"}, "no thing"),
        ):
            status, told = asked(server, "do", {"edit": edit, **fresh(server)})
            assert status == 422 and words in told["error"] and "\n" not in told["error"], told
            assert len(told["error"]) < 1000
        assert not file.exists()
        file.write_text("edits = 3\n")
        now = asked(server, "now")[1]
        assert "edits.toml" in now["trouble"] and now["rows"] == []
        assert asked(server, "do", {**RENAME, **fresh(server)})[0] in (409, 422)
        assert file.read_text() == "edits = 3\n"


def test_read_only_and_nothing_to_edit(tmp_path: Path) -> None:
    seen, file = room_map(tmp_path / "map"), tmp_path / "edits.toml"
    with served(Desk(seen.root, file, read_only=True)) as server:
        status, told = asked(server, "do", {**RENAME, **fresh(server)})
        assert status == 403 and "for reading" in told["error"] and not file.exists()
    with served(Desk(seen.root, None)) as server:
        now = asked(server, "now")[1]
        assert (
            "rows" not in now and asked(server, "do", {**RENAME, "artifact": now["artifact"], "revision": ""})[0] == 403
        )
    for words, code in (
        (["--edit", str(tmp_path / "no" / "edits.toml")], 2),
        (["--read-only"], 2),
        (["--save", str(tmp_path / "a.html"), "--edit", str(file)], 2),
        (["--save", str(tmp_path / "a.html"), "--rerun"], 2),
    ):
        assert scenewright(["view", str(seen.root), *words]) == code
    assert scenewright(["view", str(tmp_path / "nothing")]) == 3
    file.write_text("edits = 3\n")
    assert scenewright(["view", str(seen.root), "--edit", str(file)]) == 3
    seal_alone = seal(tmp_path / "alone", "contact_graph") if (tmp_path / "alone").mkdir() is None else None
    assert seal_alone is not None
    with pytest.raises(BadInput):
        Desk(tmp_path / "alone", tmp_path / "edits2.toml")


def test_an_artifact_that_changes_under_the_page(tmp_path: Path) -> None:
    seen, file = room_map(tmp_path / "map"), tmp_path / "edits.toml"
    with served(Desk(seen.root, file)) as server:
        known, page = fresh(server), asked(server, "")[1]
        # Half written: the manifest is not there yet. What was there before is shown, and nothing is written.
        manifest = seen.root / "manifest.json"
        kept = manifest.read_bytes()
        manifest.unlink()
        assert "not an artifact" in asked(server, "now")[1]["trouble"] and asked(server, "")[1] == page
        assert asked(server, "do", {**RENAME, **known})[0] in (409, 422) and not file.exists()
        manifest.write_bytes(kept)
        assert asked(server, "now")[1]["trouble"] == ""
        # Made anew: a stale page is told so; a page that is loaded again goes on.
        shutil.rmtree(seen.root)
        room_map(seen.root, spacing=0.04, number={3: 40})
        assert "made anew" in asked(server, "now")[1]["trouble"]
        status, told = asked(server, "do", {**RENAME, **known})
        assert status == 409 and "load the page again" in told["error"] and not file.exists()
        assert asked(server, "")[1] != page
        _, told = asked(server, "do", {"edit": {"what": "rename", "of": "cup_40", "class": "bottle"}, **fresh(server)})
        assert "bottle_40" in told["things"]


class Support(Edit):
    """What the thing stands on."""

    what: Literal["support"]
    of: Anchor
    on: Anchor | Literal["floor"]
    at: Point | None = None
    degrees: float = Field(0.0, ge=-180, le=180)
    movable: bool = False
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    kind: Literal["hinge", "slide"]
    title: Annotated[str, Field(max_length=30)] = ""


class Strange(Edit):
    """Something that a page cannot ask for."""

    what: Literal["strange"]
    table: dict[str, int]


def test_forms_come_from_the_declaration_of_the_edits() -> None:
    forms = {form["what"]: form for form in forms_of(kinds_of(MapEdit))}
    kinds = {what: {field["name"]: field["kind"] for field in form["fields"]} for what, form in forms.items()}
    assert kinds == {
        "rename": {"of": "thing", "class": "class"},
        "delete": {"of": "thing"},
        "merge": {"of": "things"},
        "split": {"of": "thing", "part": "box", "class": "class"},
        "add": {"box": "box", "class": "class", "surface": "choice"},
        "gravity": {"level": "points"},
        "floor": {"at": "point"},
    }
    scene = {form["what"]: {field["name"]: field for field in form["fields"]} for form in forms_of(kinds_of(AnyEdit))}
    assert {name: field["kind"] for name, field in scene["move"].items()} == {
        "of": "thing", "to": "place", "turn_degrees": "number", "carried": "yes",
    }  # fmt: skip
    assert scene["new_joint"]["axis"]["kind"] == "direction" and scene["joint"]["at"]["kind"] == "joint"
    model = scene["model"]["model"]
    assert model.pop("says").startswith("Id of a model")
    assert model == {"name": "model", "needed": True, "start": None, "kind": "model", "choices": ["none"]}
    assert scene["support"]["on"]["choices"] == ["nothing"] and scene["support"]["on"]["needed"]
    assert not scene["new_joint"]["handle"]["needed"]
    assert forms["merge"]["fields"][0]["fewest"] == 2 and forms["rename"]["says"].startswith("The thing is")
    assert next(field for field in forms["add"]["fields"] if field["name"] == "surface")["start"] == "seen"
    (support,) = forms_of([Support, Strange])
    fields = {field["name"]: field for field in support["fields"]}
    assert [fields[name]["kind"] for name in ("on", "at", "degrees", "movable", "axis", "kind", "title")] == [
        "thing", "point", "number", "yes", "numbers", "choice", "text",
    ]  # fmt: skip
    assert fields["on"]["choices"] == ["floor"] and fields["degrees"]["most"] == 180 and not fields["at"]["needed"]
    assert ClassName and UprightBox  # what the kinds above are made of


def opened(window: Browser, address: str) -> None:
    window.open("about:blank")
    window.open(address)
    settled(window)


UP_TO_DATE = (
    "return !!(document.body && document.body.dataset.desk && document.body.dataset.drawn)"
    " && document.body.dataset.revision === window.scenewright.shown.served.revision"
)


def settled(window: Browser) -> None:
    """Wait until the page shows what the file says."""
    until(window, UP_TO_DATE, True)


def until(window: Browser, script: str, wanted: Any) -> None:
    """Wait until a script returns what is wanted; pages that are being loaded have no answer, or none for long."""
    deadline, found = time.monotonic() + 180, None
    while found != wanted:
        assert time.monotonic() < deadline, (found, wanted, window.text("body")[:1500])
        with contextlib.suppress(urllib.error.HTTPError, TimeoutError):
            found = window.run(script)
        time.sleep(0.05)


def fill(window: Browser, selector: str, value: str) -> None:
    script = (
        "const i = document.querySelector(arguments[0]); i.value = arguments[1]; i.dispatchEvent(new Event('input'))"
    )
    window.run(script, selector, value)


def look_at(window: Browser, point: tuple[float, float, float], far: float = 1.0) -> None:
    script = (
        "const s = window.scenewright; s.state.target = arguments[0]; s.state.eye = [-1.2, 0.9, arguments[1]]; s.draw()"
    )
    window.run(script, list(point), far)
    time.sleep(0.3)


THINGS = "return [...document.querySelectorAll('#desk li')].map((row) => row.querySelector('span').textContent)"


@needs_browser
def test_what_others_write_while_a_form_is_open_is_shown_when_it_is_closed(tmp_path: Path) -> None:
    """The page once compared with what it was told last: told while it could not load again, it never did."""
    seen, file = room_map(tmp_path / "map"), tmp_path / "edits.toml"
    with served(Desk(seen.root, file)) as server, browser(*WEBGL) as window:
        opened(window, server.page_address)
        window.press("[data-kind=rename]")
        assert asked(server, "do", {**RENAME, **fresh(server)})[0] == 200
        until(window, THINGS, ["applied"])
        assert window.run(UP_TO_DATE) is False
        window.run("[...document.querySelectorAll('#desk form button')].at(-1).click()")  # never mind
        settled(window)


@needs_browser
def test_clicks_become_lines_and_the_map_as_it_is_then(tmp_path: Path) -> None:
    seen, file = room_map(tmp_path / "map"), tmp_path / "edits.toml"
    with served(Desk(seen.root, file)) as server, browser(*WEBGL) as window:
        opened(window, server.page_address)
        # Rename: click on the cup in the picture, name a class, write it down.
        look_at(window, (0.24, 0.04, 0.85), 0.8)
        window.click_at("#picture", 0, 0)
        until(window, "return window.scenewright.state.chosen", "cup_3")
        window.press("[data-kind=rename]")
        assert window.run("return document.querySelector('#desk [type=submit]').disabled")
        fill(window, "[data-field=class]", "bottle")
        fill(window, "[data-field=note]", HOSTILE)
        window.press("#desk [type=submit]")
        until(window, THINGS, ["applied"])
        settled(window)
        assert window.run("return Object.values(window.scenewright.shown.meshes[0].names)").count("bottle_3") == 1
        assert window.run("return document.title").startswith("panoptic_map")
        assert window.run("return document.querySelectorAll('#desk img').length") == 0
        # By the keyboard: d asks for what is to be deleted, a click gives it, Enter writes it down.
        look_at(window, (-0.26, 0.04, 0.85), 0.8)
        window.run("document.getElementById('picture').focus()")
        window.keys("d")
        window.click_at("#picture", 0, 0)
        until(window, "return document.querySelector('#desk .thing')?.textContent", "cup_4 ×")
        window.keys("\ue007")
        until(window, THINGS, ["applied", "applied"])
        settled(window)
        # Merge: two clicks.
        window.press("[data-kind=merge]")
        for point in ((-0.6, 0.95, 0.9), (0.45, -0.2, 0.75)):
            look_at(window, point)
            window.click_at("#picture", 0, 0)
        until(window, "return document.querySelectorAll('#desk .thing').length", 2)
        window.press("#desk [type=submit]")
        until(window, THINGS, ["applied"] * 3)
        settled(window)
        # A box out of two clicks: what of the table lies in it becomes a thing of its own.
        window.press("[data-kind=split]")
        look_at(window, (0.45, -0.2, 0.75))
        window.click_at("#picture", 0, 0)
        until(window, "return document.querySelectorAll('#desk .thing').length", 1)
        for point in ((0.3, -0.3, 0.75), (0.55, 0.3, 0.75)):
            look_at(window, point)
            window.click_at("#picture", 0, 0)
        until(window, "return document.querySelectorAll('#desk [data-field=part] input').length", 7)
        fill(window, "[data-field=class]", "box")
        window.press("#desk [type=submit]")
        until(window, THINGS, ["applied"] * 4)
        settled(window)
        # Undo deletes the line.
        window.press("#desk li[data-number='4'] button")
        until(window, THINGS, ["applied"] * 3)
        settled(window)
        # Somebody else writes: this page is told, and shows it.
        with served(Desk(seen.root, file)) as other:
            body = {"edit": {"what": "rename", "of": "bottle_3", "class": "vase"}, **fresh(other)}
            assert asked(other, "do", body)[0] == 200
        until(window, THINGS, ["applied"] * 4)
        settled(window)
        assert window.complaints() == []
        out = tmp_path / "edited"
        command = ["edit", "map", "--panoptic-map", str(seen.root), "--edits", str(file), "--out", str(out)]
        assert scenewright(command) == 0
        assert {f"{one.class_name}_{one.instance}" for one in PanopticMap(out).info.entities} == {
            "floor_1", "vase_3", "cabinet_5",
        }  # fmt: skip
        assert read_edits(file).edits[0].note == HOSTILE.replace("\n", " ")


@needs_browser
def test_a_map_of_five_hundred_things_can_be_put_right(tmp_path: Path) -> None:
    meshes, names = {1: dense(floor_mesh(), 0.2)}, {1: "floor"}
    for k in range(2, 502):
        x, y = 0.3 * (k % 25), 0.3 * (k // 25)
        meshes[k], names[k] = dense(box_mesh((x, y, 0.0), (x + 0.15, y + 0.15, 0.2)), 0.08), "box"
    (tmp_path / "map").mkdir()
    write_map(tmp_path / "map", meshes, names)
    seal(tmp_path / "map", "panoptic_map")
    file = tmp_path / "edits.toml"
    with served(Desk(tmp_path / "map", file)) as server, browser(*WEBGL) as window:
        opened(window, server.page_address)
        assert len(EntitiesFile.read(tmp_path / "map" / "entities.json").entities) == 501
        begun = time.monotonic()
        for k in (7, 70, 400):
            edit = {"what": "rename", "of": f"box_{k}", "class": "book"}
            assert asked(server, "do", {"edit": edit, **fresh(server)})[0] == 200
        assert time.monotonic() - begun < 20
        until(window, THINGS, ["applied"] * 3)
        assert window.complaints() == []
    assert np.all([edit.what == "rename" for edit in read_edits(file).edits])


def test_names_with_everything_in_them_stay_text(tmp_path: Path) -> None:
    """What a log or a person said is data in the page: no tag begins in it."""
    seen, file = room_map(tmp_path / "map"), tmp_path / "edits.toml"
    hostile_folder = tmp_path / "a <b>'\"&"
    shutil.copytree(seen.root, hostile_folder)
    with served(Desk(hostile_folder, file)) as server:
        asked(server, "do", {**RENAME, **fresh(server), "note": HOSTILE, "by": HOSTILE})
        page = asked(server, "")[1]
        assert "<img src=x" not in page and "<b>'" not in page.split("<script", 1)[1].split("@license")[0]
        assert asked(server, "now")[1]["rows"][0]["note"] == HOSTILE
    with pytest.raises(UsageError):
        Desk(seen.root, None).append({}, artifact="", revision="", by="", note="")
