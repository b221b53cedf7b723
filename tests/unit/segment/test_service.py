"""The segmentation service: round trip, every fault, retries, going on after a server died."""

from __future__ import annotations

import base64
import contextlib
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scenewright.cli.segmentation_server import open_server
from scenewright.schemas.errors import BadInput, MachineFailure, MissingDependency, ScenewrightError, UsageError
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.segments import Segments
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.engine.keys import library_versions
from scenewright.stages.kit.formats.frames import Frame, FrameReader
from scenewright.stages.kit.formats.masks import encode_panoptic_png
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.services.connection import Connection
from scenewright.stages.kit.services.segmentation_protocol import (
    PROTOCOL,
    Category,
    SegmentRequest,
    encode_request,
    parse_info,
    parse_reply,
    parse_request,
    split_multipart,
)
from scenewright.stages.kit.stage import Context
from scenewright.stages.segment.backends.geometric.backend import GeometricBackend
from scenewright.stages.segment.backends.service import reply_cache
from scenewright.stages.segment.backends.service.server import SegmentationServer
from scenewright.stages.segment.choice import BackendRequest, choose_backend
from scenewright.stages.segment.geometric import GeometricFrame
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask
from scenewright.stages.segment.parameters import STAGE, SegmentParameters
from scenewright.stages.segment.registry import all_backends, check_backend
from scenewright.stages.segment.settings import geometric_settings
from scenewright.stages.segment.stage import run

from tests.unit.segment.test_stage import Written, payload, write_sequence

CATEGORIES = {3: Category(id=3, name="chair"), 7: Category(id=7, name="wall-brick", isthing=0)}
FAST = {"retries": 0, "retry_wait": 0.0, "request_timeout": 5.0}


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Written:
    return write_sequence(tmp_path_factory.mktemp("room") / "sequence", frames=3)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(reply_cache.ENVIRONMENT, str(tmp_path / "replies"))
    return tmp_path / "replies"


def segment(room: Written, out: Path, backend: str, *, force: bool = False, **options: Any) -> Segments:
    out.mkdir(parents=True)
    context = Context(output=out, seed=0, device="cpu", progress=SilentProgress(), force=force)
    fast = FAST if backend.startswith("http") else {}
    parameters = SegmentParameters(backend=backend, **{**fast, **options})
    return run(room.sequence, parameters=parameters, context=context)


@contextlib.contextmanager
def serving(server: ThreadingHTTPServer) -> Iterator[str]:
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
    thread.start()
    try:
        host, port = server.server_address[:2]
        yield f"http://{host!s}:{port}"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def reference_server() -> SegmentationServer:
    parameters = SegmentParameters(backend="geometric")
    backend = choose_backend(BackendRequest(parameters))
    return SegmentationServer(
        "127.0.0.1", 0, backend, geometric_settings(parameters), revision="r1", required=("depth",)
    )


def good_reply(shape: tuple[int, int], **changes: Any) -> dict[str, Any]:
    ids = np.zeros(shape, dtype=int)
    ids[: shape[0] // 2], ids[shape[0] // 2 :, : shape[1] // 2] = 300, 5
    return {
        "protocol": PROTOCOL,
        "segments_info": [{"id": 300, "category_id": 3, "score": 0.75}, {"id": 5, "category_id": 7, "isthing": 0}],
        "panoptic_png": base64.b64encode(encode_panoptic_png(ids)).decode(),
        **changes,
    }


class FakeServer(ThreadingHTTPServer):
    """Says what a test wants it to say: `answer(number of the request) -> (status, headers, body)`."""

    daemon_threads = True

    def __init__(self, answer: Callable[[int], tuple[int, dict[str, str], bytes]], info: bytes | None = None) -> None:
        self.answer, self.requests, self.bodies = answer, 0, []
        description = {
            "protocol": PROTOCOL,
            "name": "fake",
            "revision": "1",
            "streams": ["color"],
            "required": ["color"],
            "categories": [{**c.model_dump(), "supercategory": "x"} for c in CATEGORIES.values()],
        }
        self.info = info if info is not None else json.dumps(description).encode()
        super().__init__(("127.0.0.1", 0), FakeHandler)


class FakeHandler(BaseHTTPRequestHandler):
    server: FakeServer
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        self._say(200, {}, self.server.info)

    def do_POST(self) -> None:
        self.server.bodies.append(self.rfile.read(int(self.headers["Content-Length"])))
        number = self.server.requests
        self.server.requests += 1
        self._say(*self.server.answer(number))

    def _say(self, status: int, headers: dict[str, str], body: bytes) -> None:
        self.send_response(status)
        for name, value in {"Content-Type": "application/json", "Content-Length": str(len(body)), **headers}.items():
            self.send_header(name, value)
        self.end_headers()
        with contextlib.suppress(OSError):
            self.wfile.write(body)

    def log_message(self, format: str, *arguments: object) -> None:
        return


def always(value: Any) -> Callable[[int], tuple[int, dict[str, str], bytes]]:
    body = value if isinstance(value, bytes) else json.dumps(value).encode()
    return lambda number: (200, {}, body)


def shape_of(room: Written) -> tuple[int, int]:
    camera = room.sequence.info.camera
    return camera.height, camera.width


# ---- round trip ----------------------------------------------------------------------------------------------------


def a_mask_each(self: GeometricBackend, frame: Frame, geometric: GeometricFrame, random: Any) -> PanopticFrame:
    numbers = np.unique(geometric.labels[geometric.labels > 0]).tolist()
    mask = PanopticMask(load_vocabulary().by_name("chair").id, True, 0.5)
    return PanopticFrame(geometric.labels, dict.fromkeys(numbers, mask))


def test_the_reference_server_equals_the_local_backend(
    room: Written, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(GeometricBackend, "__call__", a_mask_each)
    local = segment(room, tmp_path / "local", "geometric", fusion="thesis")
    assert local.summary["named_share"] == 1
    with serving(reference_server()) as address:
        remote = segment(room, tmp_path / "remote", address, fusion="thesis")
    ours, theirs = payload(local), payload(remote)
    assert ours[1] == theirs[1]  # every pixel of every frame
    assert [entry.segments for entry in local.info.frames] == [entry.segments for entry in remote.info.frames]
    assert remote.info.backend == "masks"
    assert remote.info.label.startswith(f"masks of {local.info.label} r1 labels ")
    assert local.outcome == remote.outcome == "ok"


def test_a_service_that_names_nothing_is_empty(room: Written, tmp_path: Path) -> None:
    """It was asked for names; `geometric`, which it serves, is not."""
    with serving(reference_server()) as address:
        assert segment(room, tmp_path / "remote", address).outcome == "empty"


def test_foreign_categories_are_mapped_by_name(room: Written, tmp_path: Path) -> None:
    vocabulary = load_vocabulary()
    with serving(FakeServer(always(good_reply(shape_of(room))))) as address:
        made = segment(room, tmp_path / "out", address)
        table = tmp_path / "mine.toml"
        table.write_text('labels = [{ name = "chair", class = "table" }, { name = "wall-brick", class = "door" }]')
        (tmp_path / "other").mkdir()
        context = Context(output=tmp_path / "other", seed=0, device="cpu", progress=SilentProgress())
        other = run(room.sequence, labels=table, parameters=SegmentParameters(backend=address, **FAST), context=context)
    for result, names in ((made, {"chair", "wall"}), (other, {"table", "door"})):
        classes = {s.class_id for frame in result.info.frames for s in frame.segments if s.class_id}
        assert classes == {vocabulary.by_name(name).id for name in names}
    assert {s.score for frame in made.info.frames for s in frame.segments if s.is_thing} == {0.75}


def test_a_request_survives_the_wire() -> None:
    random = np.random.default_rng(3)
    color = random.integers(0, 255, (12, 16, 3)).astype(np.uint8)
    depth = (random.integers(0, 5000, (12, 16)) / np.float32(1000)).astype(np.float32)
    camera = Camera(width=16, height=12, fx=20.5, fy=21, cx=8, cy=6)
    pose = np.eye(4)
    pose[:3, 3] = 0.1, -1 / 3, 2
    frame = Frame(7, 1.5, color, depth, None, pose, "left")
    body, kind = encode_request(SegmentRequest(frame, camera, 11), ("color", "depth", "pose"))
    assert (body, kind) == encode_request(SegmentRequest(frame, camera, 11), ("color", "depth", "pose"))
    back = parse_request(body, kind)
    assert back.camera == camera and back.seed == 11 and back.frame.index == 7 and back.frame.camera_name == "left"
    assert np.array_equal(back.frame.color, color) and np.array_equal(back.frame.depth, depth)
    assert np.array_equal(back.frame.world_from_camera, pose)
    bare = parse_request(*encode_request(SegmentRequest(frame, camera, 0), ()))
    assert bare.frame.color is None and bare.frame.depth is None and bare.frame.world_from_camera is None


# ---- faults --------------------------------------------------------------------------------------------------------

REPLY_FAULTS: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "no JSON": (lambda r: b"<html>", "not JSON"),
    "a list": (lambda r: [r], "not a JSON object"),
    "no UTF-8": (lambda r: b'{"protocol": "\xff"}', "not JSON"),
    "NaN": (lambda r: json.dumps(r).replace("0.75", "NaN").encode(), "NaN is not a number"),
    "infinite": (lambda r: json.dumps(r).replace("0.75", "1e999").encode(), "score inf"),
    "deep": (lambda r: b"[" * 100_000, "not JSON"),
    "another protocol": (lambda r: {**r, "protocol": "scenewright-segmentation/2"}, "speaks 'scenewright-segm"),
    "bad PNG": (lambda r: {**r, "panoptic_png": base64.b64encode(b"\x89PNG\r\n\x1a\n" + b"x" * 50).decode()}, "PNG"),
    "bad base64": (lambda r: {**r, "panoptic_png": "%%%"}, "base64"),
    "no image": (lambda r: {**r, "panoptic_png": None}, "missing"),
    "grey": (
        lambda r: {**r, "panoptic_png": base64.b64encode(cv2.imencode(".png", np.zeros((4, 4), np.uint8))[1]).decode()},
        "three channels",
    ),
    "wrong size": (lambda r: good_reply((8, 6)), "its image is 6x8"),
    "id not listed": (lambda r: {**r, "segments_info": r["segments_info"][:1]}, "id 5 of its image is not"),
    "id twice": (lambda r: {**r, "segments_info": r["segments_info"] * 2}, "300 comes twice"),
    "id zero": (lambda r: {**r, "segments_info": [{"id": 0, "category_id": 3}]}, "id 0"),
    "id true": (lambda r: {**r, "segments_info": [{"id": True, "category_id": 3}]}, "id True"),
    "category": (lambda r: {**r, "segments_info": [{"id": 5, "category_id": 99}]}, "category 99"),
    "category text": (lambda r: {**r, "segments_info": [{"id": 5, "category_id": "3"}]}, "category '3'"),
    "score": (lambda r: {**r, "segments_info": [{"id": 5, "category_id": 3, "score": 1.5}]}, "score 1.5"),
    "isthing": (lambda r: {**r, "segments_info": [{"id": 5, "category_id": 3, "isthing": "no"}]}, "isthing"),
    "no list": (lambda r: {**r, "segments_info": {}}, "not a list"),
    "too many": (lambda r: {**r, "segments_info": [{}] * 65537}, "65537 segments"),
    "no object": (lambda r: {**r, "segments_info": [3]}, "not an object"),
}


@pytest.mark.parametrize("fault", REPLY_FAULTS)
def test_malformed_replies(fault: str) -> None:
    change, text = REPLY_FAULTS[fault]
    broken = change(good_reply((12, 16)))
    body = broken if isinstance(broken, bytes) else json.dumps(broken).encode()
    with pytest.raises(BadInput) as caught:
        parse_reply(body, "application/json", (12, 16), CATEGORIES)
    assert text in caught.value.message and "\n" not in str(caught.value)


def test_a_good_reply_is_good() -> None:
    reply = parse_reply(
        json.dumps(good_reply((12, 16))).encode(), "application/json; charset=utf-8", (12, 16), CATEGORIES
    )
    assert sorted(reply.segments) == [5, 300] and set(np.unique(reply.ids)) == {0, 5, 300}
    assert reply.segments[300].is_thing and not reply.segments[5].is_thing


@pytest.mark.parametrize(
    ("answer", "error", "text"),
    [
        (lambda n: (200, {}, b"{}"), BadInput, "reply: it speaks None"),
        (lambda n: (200, {"Content-Type": "text/html"}, b"<p>"), BadInput, "content type is 'text/html'"),
        (lambda n: (404, {}, b'{"error": "no such\\npath"}'), BadInput, "status 404 (no such path)"),
        (lambda n: (503, {}, b"busy"), MachineFailure, "status 503 (busy), after one try"),
        (lambda n: (302, {"Location": "http://127.0.0.1:1/"}, b""), BadInput, "status 302"),
        (lambda n: (200, {"Content-Length": str(2**40)}, b"x"), BadInput, "more than"),
        (lambda n: (200, {"Content-Length": "99", "Connection": "close"}, b"{"), MachineFailure, "broke off|no answer"),
    ],
)
def test_faulty_answers(room: Written, tmp_path: Path, answer: Any, error: type[ScenewrightError], text: str) -> None:
    with serving(FakeServer(answer)) as address, pytest.raises(error, match=None) as caught:
        segment(room, tmp_path / "out", address, request_timeout=0.5)
    import re

    assert re.search(text.replace("(", r"\(").replace(")", r"\)"), caught.value.message), caught.value.message
    assert "frame 0" in caught.value.message and "\n" not in str(caught.value)
    assert caught.value.exit_code == (3 if error is BadInput else 6)


def test_no_server(room: Written, tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # bound and not listening: connections are refused
        address = f"http://127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(
            MissingDependency, match="no segmentation service answers: .*refused, after one try"
        ) as caught:
            segment(room, tmp_path / "out", address)
    assert caught.value.exit_code == 5 and "models serve" in caught.value.hint


@pytest.mark.parametrize("drip", [b"", b"H"])
def test_slow_server(drip: bytes) -> None:
    """A server that says nothing, and one that says a byte now and then, are late after the same time."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        stop = threading.Event()

        def dribble() -> None:
            connection, _ = listener.accept()
            with connection, contextlib.suppress(OSError):
                while not stop.wait(0.05):
                    if drip:
                        connection.sendall(drip)

        thread = threading.Thread(target=dribble, daemon=True)
        thread.start()
        address = f"http://127.0.0.1:{listener.getsockname()[1]}"
        begun = time.monotonic()
        with pytest.raises(MachineFailure, match="no answer within 0.3 s, after one try"):
            Connection(address, timeout=0.3, retries=0, retry_wait=0).get("/v1/info")
        assert 0.25 < time.monotonic() - begun < 3
        stop.set()
        thread.join()


def test_no_http() -> None:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()

        def greet() -> None:
            connection, _ = listener.accept()
            with connection:
                connection.recv(1000)
                connection.sendall(b"SSH-2.0-OpenSSH\r\n")

        thread = threading.Thread(target=greet, daemon=True)
        thread.start()
        address = f"http://127.0.0.1:{listener.getsockname()[1]}"
        with pytest.raises(MachineFailure, match="no HTTP"):
            Connection(address, timeout=5, retries=0, retry_wait=0).get("/v1/info")
        thread.join()


def test_retry_with_backoff(room: Written, tmp_path: Path) -> None:
    reply = json.dumps(good_reply(shape_of(room))).encode()
    server = FakeServer(lambda n: (503, {"Retry-After": "7"}, b"") if n == 0 else (200, {}, reply))
    waits: list[float] = []
    with serving(server) as address:
        connection = Connection(address, timeout=5, retries=3, retry_wait=0.5, sleep=waits.append)
        assert connection.post("/v1/segment", b"x", "text/plain").body == reply and waits == [7.0]
        server.answer = lambda n: (500, {}, b"")
        with pytest.raises(MachineFailure, match="status 500 .*after 4 tries"):
            connection.post("/v1/segment", b"x", "text/plain")
        assert waits[1:] == [0.5, 1.0, 2.0]
        server.requests, server.answer = 0, lambda n: (503, {}, b"") if n == 0 else (200, {}, reply)
        made = segment(room, tmp_path / "out", address, retries=1)
        assert made.outcome == "ok" and server.requests == 4  # three frames, one of them twice


@pytest.mark.parametrize(
    ("info", "text"),
    [
        (b"{}", "speaks None"),
        (json.dumps({"protocol": PROTOCOL, "name": "x", "revision": "1"}).encode(), "no categories"),
        (
            json.dumps({"protocol": PROTOCOL, "name": "x", "revision": "1", "categories": [{"id": 1}]}).encode(),
            "malform",
        ),
        (
            json.dumps(
                {"protocol": PROTOCOL, "name": "a\nb", "revision": "1", "categories": [{"id": 1, "name": "chair"}]}
            ).encode(),
            "printable",
        ),
        (
            json.dumps(
                {"protocol": PROTOCOL, "name": "x", "revision": "1", "categories": [{"id": 1, "name": "quark"}]}
            ).encode(),
            "no table",
        ),
    ],
)
def test_malformed_descriptions(room: Written, tmp_path: Path, info: bytes, text: str) -> None:
    with serving(FakeServer(always(b""), info)) as address, pytest.raises(BadInput, match=text):
        segment(room, tmp_path / "out", address)


# ---- going on ------------------------------------------------------------------------------------------------------


def test_a_run_goes_on_where_the_server_died(room: Written, tmp_path: Path, cache: Path) -> None:
    reply = json.dumps(good_reply(shape_of(room))).encode()
    server = FakeServer(lambda n: (200, {}, reply) if n < 1 else (500, {}, b""))
    with serving(server) as address:
        with pytest.raises(MachineFailure, match="frame 1: .*status 500") as caught:
            segment(room, tmp_path / "a", address)
        assert "goes on with this frame" in caught.value.hint
        assert len(list(cache.glob("*/*.json"))) == 1
        server.requests, server.answer = 0, always(reply)
        resumed = segment(room, tmp_path / "b", address)
        assert server.requests == 2  # frames 1 and 2
        again = segment(room, tmp_path / "c", address, force=True)
        assert server.requests == 5  # --force asks for all
        assert payload(resumed) == payload(again)
        # A kept reply that was damaged is asked for again.
        for path in cache.glob("*/*.json"):
            path.write_bytes(path.read_bytes()[:-5])
        assert payload(segment(room, tmp_path / "d", address)) == payload(again) and server.requests == 8


def test_the_cache_is_whole_or_not_and_bounded(tmp_path: Path, cache: Path) -> None:
    replies = reply_cache.ReplyCache("model 1")
    assert replies.find(b"question") is None
    for k in range(4):
        replies.keep(b"question %d" % k, b"x" * 100)
    assert replies.find(b"question 1") == b"x" * 100 and reply_cache.ReplyCache("model 2").find(b"question 1") is None
    reply_cache.prune(250)
    assert len(list(cache.glob("*/*"))) == 2
    blocked = tmp_path / "file"
    blocked.write_text("")
    other = reply_cache.ReplyCache("model 3")
    other.folder = blocked / "folder"
    other.keep(b"a", b"b")  # warns, and the run goes on
    assert other.find(b"a") is None


# ---- the key -------------------------------------------------------------------------------------------------------


def test_another_model_behind_the_address_is_another_result(room: Written, tmp_path: Path) -> None:
    reply = always(good_reply(shape_of(room)))
    server = FakeServer(reply)
    with serving(server) as address:
        parameters = SegmentParameters(backend=address, **FAST)
        name = f"service {address}"
        first = library_versions(STAGE, parameters)[name]
        assert first.startswith("fake 1 labels ")
        server.info = server.info.replace(b'"revision": "1"', b'"revision": "2"')
        assert library_versions(STAGE, parameters)[name] == first.replace("fake 1", "fake 2")
        pinned = SegmentParameters(backend=address, service_model=first, **FAST)
        assert library_versions(STAGE, pinned)[name] == first
        with pytest.raises(BadInput, match="runs 'fake 2 .*not 'fake 1"):
            segment(room, tmp_path / "out", address, service_model=first)
    with pytest.raises(MissingDependency, match="no segmentation service"):
        library_versions(STAGE, parameters)
    assert library_versions(STAGE, pinned)[name] == first  # known without asking


# ---- frames without colour -----------------------------------------------------------------------------------------


def test_sequences_and_frames_without_color(room: Written, tmp_path: Path) -> None:
    info = room.sequence.info.model_copy(update={"streams": ("depth",)})
    server = FakeServer(always(good_reply(shape_of(room))))
    with serving(server) as address, FrameReader(room.sequence.path("frames.mcap")) as reader:
        parameters = SegmentParameters(backend=address, **FAST)

        class Blind:
            pass

        blind: Any = Blind()
        blind.info = info
        with pytest.raises(BadInput, match="no color, which http"):
            choose_backend(BackendRequest(parameters, sequence=blind, reader=reader))
        backend = choose_backend(BackendRequest(parameters, sequence=room.sequence, reader=reader))
        frame = reader.read(0, streams=("depth",))
        assert frame.depth is not None

        class Geometric:
            labels = np.zeros(frame.depth.shape, dtype=np.int32)

        found = backend(frame, Geometric(), np.random.default_rng(0))  # type: ignore[arg-type]
        assert not found.masks and not found.ids.any() and server.requests == 0


# ---- the server's own manners --------------------------------------------------------------------------------------


def test_the_server_refuses_in_words(room: Written) -> None:
    frame = Frame(0, 0.0, None, np.ones((12, 16), np.float32), None, None)
    camera = Camera(width=16, height=12, fx=20, fy=20, cx=8, cy=6)
    body, kind = encode_request(SegmentRequest(frame, camera, 0), ("depth",))
    with serving(reference_server()) as address:
        connection = Connection(address, timeout=60, retries=0, retry_wait=0)
        assert json.loads(connection.get("/health").body) == {"status": "ok", "protocol": PROTOCOL}
        info = connection.get("/v1/info")
        assert parse_info(info.body, info.content_type).required == ("depth",)
        assert connection.post("/v1/segment", body, kind).content_type == "application/json"
        for sent, how, text in (
            (body, "text/plain", "multipart"),
            (body[:-30], kind, "torn"),
            (body.replace(b'"width":16', b'"width":17'), kind, "size"),
            (body.replace(b'"fx":20.0', b'"fx":-2.0'), kind, "camera"),
            (body.replace(b"segmentation/1", b"segmentation/9"), kind, "speaks"),
            (body.replace(b'name="request"', b'name="bequest"'), kind, "missing"),
        ):
            with pytest.raises(BadInput, match=text):
                connection.post("/v1/segment", sent, how)
        with pytest.raises(BadInput, match="404"):
            connection.get("/nothing")
        with pytest.raises(BadInput, match="404"):
            connection.post("/nothing", b"", "text/plain")
        host, port = address.removeprefix("http://").split(":")
        for head, status in ((b"", b" 411 "), (b"Content-Length: 99999999999\r\n", b" 413 ")):
            with socket.create_connection((host, int(port)), timeout=5) as raw:
                raw.sendall(b"POST /v1/segment HTTP/1.1\r\nHost: localhost\r\n" + head + b"\r\n")
                assert status in raw.recv(1000)
        connection.close()


def test_the_revision_follows_what_decides_the_answers(tmp_path: Path) -> None:
    config = tmp_path / "segment.toml"
    config.write_text("fusion_minimum = 400\n")
    opened = [open_server({"backend": "geometric"}, {}, config=path) for path in (None, None, config)]
    revisions = [server.info.revision for server in opened]
    for server in opened:
        server.server_close()
    assert revisions[0] == revisions[1] != revisions[2]
    for name in ("detector", "ground-truth"):
        with pytest.raises(UsageError, match="whole log"):
            open_server({"backend": name}, {})
    with pytest.raises(UsageError, match="cannot be served"):
        open_server({"backend": "http://127.0.0.1:1"}, {})


def test_every_backend_has_a_name_and_can_be_opened() -> None:
    for declared in all_backends():
        assert callable(declared.load("backend").open_backend)
    for address in (
        "http://",
        "http://host:99999",
        "http://a:b@host",
        "http://host/?q",
        "https://host/#a",
        "ftp://host",
        "x",
    ):
        with pytest.raises(ValueError):
            check_backend(address)
    assert check_backend("https://host:8765/path/") == "https://host:8765/path"


def test_a_port_that_is_taken() -> None:
    parameters = SegmentParameters(backend="geometric")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(MachineFailure, match="in use"):
            SegmentationServer(
                "127.0.0.1",
                port,
                choose_backend(BackendRequest(parameters)),
                geometric_settings(parameters),
                revision="",
                required=(),
            )


# ---- fuzz ----------------------------------------------------------------------------------------------------------

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-3, 400) | st.floats(allow_nan=False) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=12), inner, max_size=4),
    max_leaves=8,
)
GOOD = json.dumps(good_reply((4, 6))).encode()


def judged(body: bytes) -> None:
    try:
        reply = parse_reply(body, "application/json", (4, 6), CATEGORIES)
    except BadInput as error:
        assert "\n" not in error.message
        return
    assert reply.ids.shape == (4, 6) and set(np.unique(reply.ids)) - {0} == set(reply.segments)
    assert all(s.class_id in CATEGORIES and 0 <= s.score <= 1 for s in reply.segments.values())


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(["protocol", "segments_info", "panoptic_png", "extra"]), VALUES)
def test_fuzz_values_of_a_reply(key: str, value: Any) -> None:
    judged(json.dumps({**json.loads(GOOD), key: value}).encode())


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.fixed_dictionaries({}, optional={"id": VALUES, "category_id": VALUES, "score": VALUES, "isthing": VALUES}))
def test_fuzz_entries_of_a_reply(entry: dict[str, Any]) -> None:
    judged(json.dumps({**json.loads(GOOD), "segments_info": [{"id": 5, "category_id": 7}, {**entry}]}).encode())
    judged(
        json.dumps({**json.loads(GOOD), "segments_info": [{"id": 5, "category_id": 7}, {"id": 300, **entry}]}).encode()
    )


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_fuzz_bytes_of_a_reply_and_a_request(data: st.DataObject) -> None:
    def damaged(body: bytes) -> bytes:
        begin = data.draw(st.integers(0, len(body)))
        end = data.draw(st.integers(begin, min(len(body), begin + 40)))
        return body[:begin] + data.draw(st.binary(max_size=20)) + body[end:]

    judged(damaged(GOOD))
    frame = Frame(0, 0.0, np.zeros((4, 6, 3), np.uint8), np.ones((4, 6), np.float32), None, np.eye(4))
    camera = Camera(width=6, height=4, fx=20, fy=20, cx=3, cy=2)
    body, kind = encode_request(SegmentRequest(frame, camera, 0), ("color", "depth", "pose"))
    with contextlib.suppress(BadInput):
        assert parse_request(damaged(body), kind).camera.width > 0


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=200), st.text(max_size=60))
def test_fuzz_multipart(body: bytes, kind: str) -> None:
    for how in (kind, "multipart/form-data; boundary=a"):
        with contextlib.suppress(BadInput):
            assert len(split_multipart(body, how)) >= 1
