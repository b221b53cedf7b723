"""HTTP from anybody: time, size and number of what is received are bounded, and every refusal is a short JSON answer.

Python's server waits for as long as a sender likes, starts a thread for whoever connects, and prints tracebacks.
"""

from __future__ import annotations

import io
import ipaddress
import json
import logging
import socket
import socketserver
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import urlsplit

from scenewright.schemas.errors import MachineFailure, UsageError

IDLE_SECONDS = 60.0
"""A connection on which nothing comes for so long is closed."""
HEAD_SECONDS = 10.0
"""Time from the first byte of a request to the end of its header [s]."""
BODY_SECONDS = 60.0
"""Time from the end of a request's header to the end of its body [s]."""
SEND_SECONDS = 60.0
"""Time for an answer, all of it [s]."""
LINGER_SECONDS = 2.0
"""How long what a refused sender still sends is thrown away, so that it can read why."""
LARGEST_HEAD = 32 * 2**10
"""Bytes of a request line and header."""
LARGEST_BODY = 64 * 2**20
"""Largest request or answer [bytes]."""
MOST_BODIES = 256 * 2**20
"""Bytes of all bodies that are held at a time."""
MOST_CONNECTIONS = 64
"""Each has a thread; beyond them the one that has waited longest for a request is closed, or the new
one told to wait."""
PIECE = 1 << 20
"""Bytes of a body that are read at a time; by eye."""
JSON = "application/json"
BUSY = b'{"error": "too many connections"}'

logger = logging.getLogger("scenewright")
Request = socket.socket | tuple[bytes, socket.socket]


class BoundedServer(ThreadingHTTPServer):
    """A server whose threads and bodies are counted. It takes names of this machine alone while it listens there.

    `port` 0 takes a free one. Raises MachineFailure when the address cannot be had, UsageError when it is none.
    """

    daemon_threads = True
    request_queue_size = 128
    most_connections, most_bodies = MOST_CONNECTIONS, MOST_BODIES

    def __init__(self, host: str, port: int, handler: type[BoundedHandler]) -> None:
        self._host = host.lower()
        self._slots = threading.BoundedSemaphore(self.most_connections)
        self._expecting: dict[socket.socket, None] = {}
        self._held_bytes = 0
        self._lock = threading.Lock()
        if ":" in host:
            self.address_family = socket.AF_INET6
        try:
            super().__init__((host, port), handler)
        except (OSError, OverflowError) as error:
            raise MachineFailure(
                f"{host:.80}:{port}: {getattr(error, 'strerror', None) or error}", hint="choose another port or address"
            ) from None
        except (ValueError, TypeError):  # half a character, a zero byte, a label of more than 63 letters
            raise UsageError(f"{host!r:.80} is not a host name") from None

    def server_bind(self) -> None:
        """Bind, without asking a name server what this machine is called."""
        socketserver.TCPServer.server_bind(self)
        self.server_name, self.server_port = str(self.server_address[0]), int(self.server_address[1])

    @property
    def address(self) -> str:
        """Where it answers."""
        name = f"[{self.server_name}]" if ":" in self.server_name else self.server_name
        return f"http://{name}:{self.server_port}"

    @property
    def exposed(self) -> bool:
        """Whether other machines can reach it."""
        return not ipaddress.ip_address(self.server_name.partition("%")[0]).is_loopback

    def is_meant(self, host: str) -> bool:
        """Whether a Host header is one that a server of this machine alone has.

        A web page can make a browser ask this machine under the page's own name (DNS rebinding).
        """
        try:
            name = urlsplit(f"//{host}").hostname or ""
            return self.exposed or name in ("localhost", self._host) or ipaddress.ip_address(name).is_loopback
        except ValueError:
            return False

    def process_request(self, request: Request, client_address: Any) -> None:
        """Start a thread for a connection, or turn it away."""
        if not self._slots.acquire(blocking=False):
            self._close_longest_waiting()
            if not self._slots.acquire(timeout=0.05):
                self._turn_away(request)
                return
        try:
            super().process_request(request, client_address)
        except BaseException:
            self._slots.release()
            raise

    def process_request_thread(self, request: Request, client_address: Any) -> None:
        """Serve a connection until it ends."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._slots.release()

    def handle_error(self, request: Request, client_address: Any) -> None:
        """Say in the log, and only there, that a connection broke."""
        logger.debug("a connection broke", exc_info=True)

    def waits(self, connection: socket.socket, waiting: bool) -> None:
        """Note that a connection waits for a request, or no longer does."""
        with self._lock:
            self._expecting.pop(connection, None)
            if waiting:
                self._expecting[connection] = None

    def _close_longest_waiting(self) -> None:
        with self._lock:
            connection = next(iter(self._expecting), None)
            if connection is not None:
                del self._expecting[connection]
                with suppress(OSError):
                    connection.shutdown(socket.SHUT_RDWR)

    def _turn_away(self, request: Request) -> None:
        assert isinstance(request, socket.socket)
        head = f"HTTP/1.1 503 Busy\r\nContent-Type: {JSON}\r\nContent-Length: {len(BUSY)}\r\n"
        with suppress(OSError):
            request.settimeout(0.05)
            request.sendall(f"{head}Retry-After: 1\r\nConnection: close\r\n\r\n".encode() + BUSY)
            request.recv(LARGEST_HEAD)  # unread bytes would make the answer vanish with the connection
        self.shutdown_request(request)

    def hold(self, size: int) -> bool:
        """Count bytes of bodies that are held (negative: no longer); False, and nothing counted, for too many."""
        with self._lock:
            if self._held_bytes + size > self.most_bodies:
                return False
            self._held_bytes += size
            return True


class _HeadTooLarge(Exception):
    pass


class _TimedStream(io.RawIOBase):
    """What comes in on a connection until a deadline, and no more than so many bytes."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._deadline, self._room = 0.0, 0
        self.begun = False

    def allow(self, seconds: float, size: int) -> None:
        self._deadline, self._room, self.begun = time.monotonic() + seconds, size, False

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        remaining = self._deadline - time.monotonic()
        if remaining <= 0:
            raise TimeoutError
        if self._room <= 0:
            raise _HeadTooLarge
        self._connection.settimeout(remaining)
        size = self._connection.recv_into(buffer)
        self._room -= size
        self.begun = self.begun or size > 0
        return size


class BoundedHandler(BaseHTTPRequestHandler):
    """One connection to a BoundedServer. `routes`: path -> method -> what answers; a method takes the handler."""

    server: BoundedServer
    routes: Mapping[str, Mapping[str, Callable[[Any], None]]] = {}
    largest_body = LARGEST_BODY
    tells_routes = True
    """Whether who asks for another path is told which there are."""
    own_pages_only = False
    """Whether what a page of another origin asks for is refused, whatever it knows."""
    protocol_version = "HTTP/1.1"
    server_version = "scenewright"
    sys_version = ""
    _stream: _TimedStream
    _received: io.BufferedReader
    _unread = False
    """Whether more of the request may come that nobody will read."""

    def setup(self) -> None:
        """Read through a stream that knows its deadline."""
        super().setup()
        self._stream = _TimedStream(self.connection)
        self.rfile = self._received = io.BufferedReader(self._stream, 8192)

    def handle_one_request(self) -> None:
        """Receive the head of a request, judge it, and let its route answer."""
        self.close_connection = True
        self.requestline, self.request_version, self.command = "", "HTTP/1.0", ""
        try:
            self.server.waits(self.connection, True)
            self._stream.allow(IDLE_SECONDS, LARGEST_HEAD)
            if not self._received.peek(1):
                return
            self._stream.allow(HEAD_SECONDS, LARGEST_HEAD)
            self._stream.begun = True
            self.raw_requestline = self.rfile.readline(LARGEST_HEAD + 1)
            if not self.parse_request():
                return
            self.server.waits(self.connection, False)
            self._route()
        except _HeadTooLarge:
            self._refuse_unread(431, f"a header of more than {LARGEST_HEAD} bytes")
        except TimeoutError:
            self.close_connection = True
            if self._stream.begun:
                self._refuse_unread(408, "the request took too long")
        except OSError:
            self.close_connection = True  # the client is gone
        finally:
            self.server.waits(self.connection, False)

    def _route(self) -> None:
        hosts = self.headers.get_all("Host", [])
        if len(hosts) > 1 or (not hosts and self.request_version == "HTTP/1.1"):
            self._refuse_unread(400, "one Host is needed")
        elif hosts and not self.server.is_meant(hosts[0]):
            self._refuse_unread(421, "this server is for this machine alone, under a name of it (localhost, 127.0.0.1)")
        elif self.own_pages_only and not self._own_page_asks(hosts):
            self._refuse_unread(403, "pages of other origins may not ask here")
        elif (methods := self.routes.get(self.path)) is None:
            routes_there = f"; there are {', '.join(self.routes)}" if self.tells_routes else ""
            self._refuse_unread(404, f"no {self.path:.80}{routes_there}")
        elif self.command not in methods:
            allowed = ", ".join(methods)
            self._refuse_unread(405, f"{self.path} takes {allowed}", {"Allow": allowed})
        elif self.command != "POST" and (
            self.headers.get("Content-Length", "0") != "0" or "Transfer-Encoding" in self.headers
        ):
            self._refuse_unread(400, f"{self.command} takes no body")
        else:
            methods[self.command](self)

    def _own_page_asks(self, hosts: list[str]) -> bool:
        """Whether a page that was served here asks, or no page at all; browsers say whose it is (Fetch, 3.2 and
        Fetch Metadata). Going to an address by a link is no asking."""
        origins = self.headers.get_all("Origin", [])
        if origins:
            return len(origins) == 1 and bool(hosts) and origins[0].lower() == f"http://{hosts[0]}".lower()
        goes_there = self.command == "GET" and self.headers.get("Sec-Fetch-Mode") == "navigate"
        return goes_there or self.headers.get("Sec-Fetch-Site", "none") in ("none", "same-origin")

    def handle_expect_100(self) -> bool:
        """Leave the answer to `Expect: 100-continue` until it is known that the body is wanted."""
        return True

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Refuse a malformed request, as Python's parser asks for it."""
        self._refuse_unread(code, message or self.responses.get(code, ("refused", ""))[0])

    def body(self) -> bytes | None:
        """Return the body; None when it was refused. Give it back with `done`."""
        lengths = {text.strip() for text in self.headers.get_all("Content-Length", [])}
        declared = next(iter(lengths), "")
        if self.headers.get("Transfer-Encoding") is not None or not lengths:
            self._refuse_unread(411, "a Content-Length is needed")
        elif len(lengths) > 1 or not (declared.isascii() and declared.isdigit()):
            self._refuse_unread(400, "Content-Length is not a number")
        elif len(declared) > 15 or int(declared) > self.largest_body:
            self._refuse_unread(413, f"more than {self.largest_body} bytes")
        else:
            return self._read(int(declared))
        return None

    def _read(self, length: int) -> bytes | None:
        if self.headers.get("Expect", "").lower() == "100-continue" and self.request_version == "HTTP/1.1":
            self.send_response_only(100)
            self.end_headers()
        self._stream.allow(BODY_SECONDS, self.largest_body + 1)
        self._stream.begun = True
        pieces: list[bytes] = []
        received = 0
        try:
            while received < length:
                piece_size = min(PIECE, length - received)
                if not self.server.hold(piece_size):
                    self._refuse_unread(503, "too many bytes are waiting", {"Retry-After": "1"})
                    return None
                received += piece_size  # counted before it is there, as it is given back by what was counted
                part = self.rfile.read(piece_size)
                pieces.append(part)
                if len(part) < piece_size:
                    self.close_connection = True
                    return None  # the client is gone
            held_bytes, received = received, 0
            self._held_for_request = held_bytes
            return b"".join(pieces)
        finally:
            self.server.hold(-received)

    _held_for_request = 0

    def done(self) -> None:
        """Say that the body is held no longer."""
        self.server.hold(-self._held_for_request)
        self._held_for_request = 0

    def _refuse_unread(self, status: int, reason: str, headers: Mapping[str, str] | None = None) -> None:
        """Refuse a request whose body may still come: the connection ends with it."""
        self.close_connection = self._unread = True
        self.request_version = "HTTP/1.0" if self.request_version == "HTTP/0.9" else self.request_version
        with suppress(OSError):
            self.refuse(status, reason, headers)

    def refuse(self, status: int, reason: str, headers: Mapping[str, str] | None = None) -> None:
        """Answer with a reason."""
        self.answer(status, json.dumps({"error": reason}).encode(), headers)

    def answer(self, status: int, body: bytes, headers: Mapping[str, str] | None = None, *, kind: str = JSON) -> None:
        """Answer with JSON, or a body of another media type `kind`."""
        self.connection.settimeout(SEND_SECONDS)
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        for name, value in (headers or {}).items():
            self.send_header(name, value)
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def finish(self) -> None:
        """End the connection; a refused sender is heard out for a moment."""
        self.done()
        super().finish()
        if not self._unread:
            return
        with suppress(OSError):
            self.connection.shutdown(socket.SHUT_WR)
            deadline = time.monotonic() + LINGER_SECONDS
            while (remaining := deadline - time.monotonic()) > 0:
                self.connection.settimeout(remaining)
                if not self.connection.recv(1 << 16):
                    break

    def log_message(self, format: str, *arguments: object) -> None:
        """Say in the log what was asked, without what a terminal would obey."""
        text = format % arguments
        logger.debug("%s %s", self.client_address[0], "".join(c if c.isprintable() else "?" for c in text))
