"""The service among strangers: slow, huge, many, malformed, misdirected; each is answered in a line, and it goes on."""

from __future__ import annotations

import contextlib
import json
import logging
import socket
import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from scenewright.schemas.base import LARGEST_INT32
from scenewright.schemas.errors import BadInput, MachineFailure, UsageError
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.kit.services import receiving
from scenewright.stages.kit.services.connection import Connection, GivenUp
from scenewright.stages.kit.services.receiving import BoundedServer
from scenewright.stages.kit.services.segmentation_protocol import (
    LARGEST_PART,
    SegmentRequest,
    encode_request,
    split_multipart,
)
from scenewright.stages.segment.backends.service import server

from tests.unit.segment.test_service import reference_server, serving

OK = b"GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n"
POST = b"POST /v1/segment HTTP/1.1\r\nHost: localhost\r\n"


@pytest.fixture(autouse=True)
def short_times(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, seconds in (("IDLE", 0.6), ("HEAD", 0.4), ("BODY", 0.4), ("LINGER", 0.2)):
        monkeypatch.setattr(receiving, f"{name}_SECONDS", seconds)


@pytest.fixture
def address(short_times: None) -> Iterator[tuple[str, int]]:
    opened = reference_server()
    with serving(opened):
        yield "127.0.0.1", opened.server_port
        assert status(("127.0.0.1", opened.server_port), OK) == 200  # whatever happened, it goes on


def said(address: tuple[str, int], sent: bytes) -> bytes:
    """Return what is answered until the connection ends, or nothing comes for a while."""
    with socket.create_connection(address, timeout=5) as raw, contextlib.suppress(OSError):
        raw.sendall(sent)
        return everything(raw)
    return b""


def everything(raw: socket.socket) -> bytes:
    data = b""
    with contextlib.suppress(OSError):
        while part := raw.recv(65536):
            data += part
            head, end, body = data.partition(b"\r\n\r\n")
            if end and b"Content-Length: %d\r\n" % len(body) in head + b"\r\n":
                return data
    return data


def status(address: tuple[str, int], sent: bytes) -> int:
    answer = said(address, sent)
    head, _, body = answer.partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.") and isinstance(json.loads(body), dict), answer
    return int(head.split()[1])


REQUESTS: dict[str, tuple[bytes, int]] = {
    "odd path": (b"GET /%2e%2e/etc/passwd HTTP/1.1\r\nHost: localhost\r\n\r\n", 404),
    "path of a proxy": (b"GET http://example.org/health HTTP/1.1\r\nHost: localhost\r\n\r\n", 404),
    "path of 20000 letters": (b"GET /" + b"a" * 20_000 + b" HTTP/1.1\r\nHost: localhost\r\n\r\n", 404),
    "path with an escape": (b"GET /\x1b[31m HTTP/1.1\r\nHost: localhost\r\n\r\n", 404),
    "another method": (b"DELETE /v1/segment HTTP/1.1\r\nHost: localhost\r\n\r\n", 405),
    "a made up method": (b"__CLASS__ /health HTTP/1.1\r\nHost: localhost\r\n\r\n", 405),
    "post to a page": (b"POST /health HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n", 405),
    "get of a segment": (b"GET /v1/segment HTTP/1.1\r\nHost: localhost\r\n\r\n", 405),
    "no version": (b"GET /health HTTP/9.9\r\nHost: localhost\r\n\r\n", 505),
    "no HTTP": (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03 a b c d\r\n\r\n", 400),
    "no length": (POST + b"\r\n", 411),
    "in chunks": (POST + b"Transfer-Encoding: chunked\r\n\r\n5\r\nabcde\r\n0\r\n\r\n", 411),
    "chunks and a length": (POST + b"Transfer-Encoding: chunked\r\nContent-Length: 5\r\n\r\nabcde", 411),
    "two lengths": (POST + b"Content-Length: 5\r\nContent-Length: 6\r\n\r\nabcde", 400),
    "a length below zero": (POST + b"Content-Length: -5\r\n\r\n", 400),
    "a length of 6000 digits": (POST + b"Content-Length: " + b"9" * 6000 + b"\r\n\r\n", 413),
    "a length beyond the bound": (POST + b"Content-Length: 67108865\r\n\r\n", 413),
    "a body that is asked about": (POST + b"Expect: 100-continue\r\nContent-Length: 99999999999\r\n\r\n", 413),
    "a get with a body": (b"GET /health HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n\r\nabcde", 400),
    "300 headers": (OK[:-2] + b"".join(b"X-%d: y\r\n" % k for k in range(300)) + b"\r\n", 431),
    "a header of 60000 letters": (OK[:-2] + b"X: " + b"y" * 60_000 + b"\r\n\r\n", 431),
    "a request line of 60000 letters": (b"GET /" + b"a" * 60_000, 431),
    "another host": (OK.replace(b"localhost", b"evil.example"), 421),
    "a host that begins alike": (OK.replace(b"localhost", b"localhost.evil.example"), 421),
    "a host that is none": (OK.replace(b"localhost", b"[::1"), 421),
    "no host": (OK.replace(b"Host: localhost\r\n", b""), 400),
    "two hosts": (OK[:-2] + b"Host: evil.example\r\n\r\n", 400),
    "this machine by address": (OK.replace(b"localhost", b"127.0.0.1:80"), 200),
    "this machine by its other address": (OK.replace(b"localhost", b"[::1]:80"), 200),
    "an old client": (b"GET /health HTTP/1.0\r\n\r\n", 200),
    "a head that does not end": (OK[:-10], 408),
    "a body that does not come": (POST + b"Content-Length: 1000\r\n\r\nabc", 408),
    "a body that is none": (POST + b"Content-Type: text/plain\r\nContent-Length: 3\r\n\r\nabc", 400),
}


@pytest.mark.parametrize("fault", REQUESTS)
def test_every_request_is_answered(address: tuple[str, int], fault: str, capfd: pytest.CaptureFixture[str]) -> None:
    sent, expected = REQUESTS[fault]
    assert status(address, sent) == expected
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize("begin", [b"GET /health HTTP/1.1\r\nX: ", POST + b"Content-Length: 1000\r\n\r\n"])
def test_a_sender_that_trickles_is_cut(address: tuple[str, int], begin: bytes) -> None:
    with socket.create_connection(address, timeout=5) as raw:
        raw.sendall(begin)
        started = time.monotonic()
        with contextlib.suppress(OSError):
            while time.monotonic() - started < 4:
                raw.settimeout(0.05)
                with contextlib.suppress(TimeoutError):
                    if b" 408 " in raw.recv(1000):
                        break
                raw.sendall(b"y")
        assert time.monotonic() - started < 3


def test_a_connection_that_says_nothing_is_closed(address: tuple[str, int]) -> None:
    with socket.create_connection(address, timeout=5) as raw:
        assert raw.recv(10) == b""


def test_a_hundred_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(BoundedServer, "most_connections", 8)
    monkeypatch.setattr(receiving, "IDLE_SECONDS", 30.0)
    opened = reference_server()
    with serving(opened), contextlib.ExitStack() as stack:
        before = threading.active_count()
        address = ("127.0.0.1", opened.server_port)
        many = [stack.enter_context(socket.create_connection(address, timeout=5)) for _ in range(100)]
        for raw in many[:50]:
            with contextlib.suppress(OSError):
                raw.sendall(b"GET /hea")
        # Those that hold a thread and ask for nothing give way to one that does.
        answers = [said(address, OK) for _ in range(10)]
        assert threading.active_count() - before <= 8
        assert {int(answer.split()[1]) for answer in answers if answer} <= {200, 503}
        assert sum(b" 200 " in answer for answer in answers) >= 5


def test_bodies_that_are_held_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(BoundedServer, "most_bodies", 3_000_000)
    monkeypatch.setattr(receiving, "BODY_SECONDS", 5.0)
    opened = reference_server()
    with serving(opened):
        address = ("127.0.0.1", opened.server_port)
        with socket.create_connection(address, timeout=5) as slow:
            slow.sendall(POST + b"Content-Length: 2500000\r\n\r\n" + b"x" * 2_400_000)
            deadline = time.monotonic() + 5
            while opened._held_bytes < 2_000_000 and time.monotonic() < deadline:
                time.sleep(0.01)
            assert status(address, POST + b"Content-Length: 2500000\r\n\r\n" + b"x" * 2_500_000) == 503
        deadline = time.monotonic() + 5
        while opened._held_bytes and time.monotonic() < deadline:
            time.sleep(0.01)
        assert opened._held_bytes == 0
        assert status(address, POST + b"Content-Length: 2500000\r\n\r\n" + b"x" * 2_500_000) == 400


def bomb(width: int, height: int, **parts: Any) -> tuple[bytes, str]:
    camera = Camera.model_construct(width=width, height=height, fx=20.0, fy=20.0, cx=8.0, cy=6.0)
    frame = Frame(0, 0.0, parts.get("color"), parts.get("depth"), None, None)
    return encode_request(SegmentRequest(frame, camera, 0), ("color", "depth"))


@pytest.mark.parametrize(
    ("width", "height"), [(1_000_000_000, 1_000_000_000), (4000, 3000), (10**18, 10**18), (100_000, 101)]
)
def test_frames_that_unpack_to_too_much(address: tuple[str, int], width: int, height: int) -> None:
    """A picture of 12 million pixels is a few kilobytes; one that is not even there is a number."""
    connection = Connection(f"http://127.0.0.1:{address[1]}", timeout=5, retries=0, retry_wait=0)
    depth = np.zeros((height, width), np.float32) if width == 4000 else None
    words = "is malformed" if width > LARGEST_INT32 else f"more than {server.MOST_PIXELS} pixels"
    with pytest.raises(BadInput, match=words):
        connection.post("/v1/segment", *bomb(width, height, depth=depth))
    connection.close()


def test_requests_that_multiply_when_they_are_read() -> None:
    with pytest.raises(BadInput, match="torn, or too many"):
        split_multipart(b"--a\r\n" + b"\r\n--a" * 100_000, "multipart/form-data; boundary=a")
    body, kind = bomb(16, 12)
    with pytest.raises(BadInput, match=f"more than {LARGEST_PART} bytes"):
        server.parse_request(body.replace(b'"frame":0', b'"frame":0,"x":[' + b"[]," * 50_000 + b"[]]"), kind)


def test_a_failure_of_the_backend_is_one_line(
    address: tuple[str, int], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fails(*_: object) -> None:
        raise MemoryError("no memory")

    monkeypatch.setattr(server, "segment_request", fails)
    connection = Connection(f"http://127.0.0.1:{address[1]}", timeout=5, retries=0, retry_wait=0)
    with caplog.at_level(logging.INFO, "scenewright"), pytest.raises(GivenUp, match="status 500 .MemoryError"):
        connection.post("/v1/segment", *bomb(16, 12, depth=np.ones((12, 16), np.float32)))
    assert [record.exc_info for record in caplog.records] == [None]
    connection.close()


def test_two_requests_on_one_connection(address: tuple[str, int]) -> None:
    with socket.create_connection(address, timeout=5) as raw:
        for _ in range(2):
            raw.sendall(OK)
            assert b" 200 " in everything(raw)
        raw.sendall(POST + b"Expect: 100-continue\r\nContent-Length: 3\r\n\r\n")
        assert raw.recv(1000) == b"HTTP/1.1 100 Continue\r\n\r\n"
        raw.sendall(b"abc")
        assert b" 400 " in everything(raw)


@pytest.mark.parametrize("host", ["a" * 5000, "a..b", "\udcff", "x\0y"])
def test_names_that_are_no_hosts(host: str) -> None:
    with pytest.raises((UsageError, MachineFailure)) as caught:
        BoundedServer(host, 0, receiving.BoundedHandler)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 250


def test_who_listens_to_the_network_says_so(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from scenewright.cli import segmentation_server, serve_command

    monkeypatch.setattr(BoundedServer, "serve_forever", lambda self, poll_interval: None)
    for host, open_to_all in (("127.0.0.1", False), ("localhost", False), ("0.0.0.0", True), ("", True)):
        opened = BoundedServer(host, 0, receiving.BoundedHandler)
        opened.info = reference_info()  # type: ignore[attr-defined]
        monkeypatch.setattr(segmentation_server, "open_server", lambda *_, made=opened, **__: made)
        assert serve_command.serve(backend="geometric", host=host, port=0) == 0
        printed = capsys.readouterr()
        assert ("open to the network" in printed.err) is open_to_all
        assert opened.is_meant("evil.example") is open_to_all and opened.is_meant("localhost:80")


def reference_info() -> object:
    opened = reference_server()
    opened.server_close()
    return opened.info
