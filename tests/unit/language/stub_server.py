"""A stand-in for a server of language models: says what a test wants it to say, well or badly."""

from __future__ import annotations

import contextlib
import json
import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

Behaviour = Callable[["StubHandler"], None]


@dataclass
class Asked:
    """One request as it came in."""

    path: str
    headers: dict[str, str]
    body: dict[str, Any]


class StubServer(ThreadingHTTPServer):
    """Answers request k as behaviour k says, the last one from then on."""

    daemon_threads = True

    def __init__(self, *behaviours: Behaviour) -> None:
        self.behaviours, self.asked = list(behaviours), []
        self.stopped = threading.Event()
        super().__init__(("127.0.0.1", 0), StubHandler)

    @property
    def base_url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}/v1"


class StubHandler(BaseHTTPRequestHandler):
    server: StubServer
    protocol_version = "HTTP/1.1"

    def do_POST(self) -> None:
        body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        self.server.asked.append(Asked(self.path, dict(self.headers), body))
        behaviour = self.server.behaviours[min(len(self.server.asked), len(self.server.behaviours)) - 1]
        with contextlib.suppress(OSError):
            behaviour(self)

    def say(self, status: int, body: bytes, **headers: str) -> None:
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        self.send_response(status)
        for name, value in {"Content-Type": "application/json", "Content-Length": str(len(body)), **named}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *arguments: object) -> None:
        return


def envelope(content: Any, *, finish: str = "stop", usage: Any = None, **message: Any) -> bytes:
    """Return the body of a chat completion."""
    usage = {"prompt_tokens": 11, "completion_tokens": 7} if usage is None else usage
    choice = {"index": 0, "finish_reason": finish, "message": {"role": "assistant", "content": content, **message}}
    return json.dumps({"object": "chat.completion", "model": "stub", "choices": [choice], "usage": usage}).encode()


def replies(content: Any, **details: Any) -> Behaviour:
    """A sound answer whose message is `content` (a dict becomes JSON)."""
    text = json.dumps(content) if isinstance(content, dict) else content
    return lambda handler: handler.say(200, envelope(text, **details))


def status(code: int, body: bytes = b"", **headers: str) -> Behaviour:
    """Another status code."""
    return lambda handler: handler.say(code, body, **headers)


def body(data: bytes, **headers: str) -> Behaviour:
    """Any body with status 200."""
    return lambda handler: handler.say(200, data, **headers)


def silent(handler: StubHandler) -> None:
    """Says nothing until the test is over."""
    handler.server.stopped.wait(20)


def trickles(handler: StubHandler) -> None:
    """Sends a byte now and then, and never ends."""
    handler.wfile.write(b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: 100000\r\n\r\n")
    while not handler.server.stopped.wait(0.02):
        handler.wfile.write(b" ")


def hangs_up(handler: StubHandler) -> None:
    """Closes the connection without a word."""
    handler.close_connection = True
    handler.connection.shutdown(socket.SHUT_RDWR)


def breaks_off(handler: StubHandler) -> None:
    """Closes the connection within the body."""
    whole = envelope('{"answer": 1}')
    handler.wfile.write(b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n")
    handler.wfile.write(f"Content-Length: {len(whole)}\r\n\r\n".encode() + whole[:40])
    handler.wfile.flush()
    hangs_up(handler)


@contextlib.contextmanager
def serving(*behaviours: Behaviour) -> Iterator[StubServer]:
    """Run a stub server."""
    server = StubServer(*behaviours)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.stopped.set()
        server.shutdown()
        server.server_close()
        thread.join()
