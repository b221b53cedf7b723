"""HTTP to a segmentation service: time-outs that hold for a whole answer, retries, and errors in one line."""

from __future__ import annotations

import http.client
import json
import logging
import socket
import ssl
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from urllib.parse import urlsplit

from schemas.errors import BadInput, MachineFailure
from stages.segment.service.protocol import LARGEST_BODY

RETRIED = frozenset({408, 425, 429, 500, 502, 503, 504})
"""Status codes of servers that are busy, starting or stumbling."""
LONGEST_WAIT = 30.0
"""Seconds between two tries."""
LONGEST_EXCERPT = 200
"""Characters of a server's own words in an error."""

logger = logging.getLogger("scenewright")


@dataclass(frozen=True)
class Answer:
    """Body and content type of an answer with status 200."""

    body: bytes
    content_type: str


class _TryAgain(Exception):
    """A fault that may pass; `wait` is what the server asks for [s]."""

    def __init__(self, reason: str, wait: float = 0.0) -> None:
        super().__init__(reason)
        self.wait = wait


class Connection:
    """A connection to the service at `address` (http://HOST:PORT/PATH), kept open between requests.

    One answer may take `timeout` seconds, from the first byte sent to the last one received: a server that trickles is
    as late as one that is silent. Redirections and proxies are not followed. `sleep` waits between tries.
    """

    def __init__(
        self,
        address: str,
        *,
        timeout: float,
        retries: int,
        retry_wait: float,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.address = address
        self._parts = urlsplit(address)
        self._timeout, self._retries, self._retry_wait, self._sleep = timeout, retries, retry_wait, sleep
        self._open: http.client.HTTPConnection | None = None

    def get(self, path: str) -> Answer:
        """Return what the server answers. Raises MachineFailure after the last try, BadInput when it refuses."""
        return self._patiently("GET", path, None, "")

    def post(self, path: str, body: bytes, content_type: str) -> Answer:
        """Send a body; otherwise as `get`."""
        return self._patiently("POST", path, body, content_type)

    def close(self) -> None:
        """Close the connection; the next request opens another one."""
        if self._open is not None:
            self._open.close()
        self._open = None

    def _patiently(self, method: str, path: str, body: bytes | None, content_type: str) -> Answer:
        for attempt in range(self._retries + 1):
            try:
                return self._once(method, path, body, content_type)
            except BadInput:
                self.close()
                raise
            except _TryAgain as error:
                self.close()
                reason, asked = str(error), error.wait
            if attempt < self._retries:
                wait = min(LONGEST_WAIT, max(asked, self._retry_wait * 2**attempt))
                logger.warning(
                    "%s: %s; asked again in %g s (%d of %d)", self.address, reason, wait, attempt + 1, self._retries
                )
                self._sleep(wait)
        tries = f"{self._retries + 1} tries" if self._retries else "one try"
        raise MachineFailure(f"{self.address}: {reason}, after {tries}", hint="see --request-timeout and --retries")

    def _once(self, method: str, path: str, body: bytes | None, content_type: str) -> Answer:
        late = threading.Event()
        timer: threading.Timer | None = None
        reused = self._open is not None
        try:
            connection = self._connected()
            timer = threading.Timer(self._timeout, _cut, (connection, late))
            timer.daemon = True
            timer.start()
            headers = {"Accept": "application/json", "Connection": "keep-alive"}
            if body is not None:
                headers["Content-Type"] = content_type
            connection.request(method, self._parts.path + path, body, headers)
            response = connection.getresponse()
            data = self._read(response)
        except (OSError, http.client.HTTPException, ValueError) as error:
            if isinstance(error, ssl.SSLCertVerificationError):
                raise BadInput(f"{self.address}: {error.verify_message}", hint="check the certificate") from None
            if late.is_set() or isinstance(error, TimeoutError):
                raise _TryAgain(f"no answer within {self._timeout:g} s") from None
            if reused and isinstance(error, ConnectionError):
                # Servers close connections that were idle for a while: not a fault, and not worth a wait.
                self.close()
                return self._once(method, path, body, content_type)
            raise _TryAgain(_words(error)) from None
        finally:
            if timer is not None:
                timer.cancel()
        if late.is_set():
            raise _TryAgain(f"no answer within {self._timeout:g} s")
        if response.status in RETRIED:
            wait = response.getheader("Retry-After", "")
            raise _TryAgain(
                f"status {response.status} ({_excerpt(data) or response.reason})",
                float(wait) if wait.isascii() and wait.isdigit() else 0.0,
            )
        if response.status != 200:
            said = _excerpt(data) or response.reason
            raise BadInput(
                f"{self.address}{path}: status {response.status} ({said:.{LONGEST_EXCERPT}})",
                hint="is this a segmentation service? see docs/SEGMENTATION.md",
            )
        return Answer(data, response.getheader("Content-Type", ""))

    def _read(self, response: http.client.HTTPResponse) -> bytes:
        declared = response.getheader("Content-Length", "")
        length = int(declared[:20]) if declared.isascii() and declared.isdigit() else None
        data = response.read(LARGEST_BODY + 1) if length is None or length <= LARGEST_BODY else b""
        if len(data) > LARGEST_BODY or (length is not None and length > LARGEST_BODY):
            raise BadInput(f"{self.address}: an answer of more than {LARGEST_BODY} bytes", hint="mend the service")
        if length is not None and len(data) < length:
            raise http.client.IncompleteRead(data, length - len(data))
        return data

    def _connected(self) -> http.client.HTTPConnection:
        if self._open is None:
            assert self._parts.hostname is not None
            kind = http.client.HTTPSConnection if self._parts.scheme == "https" else http.client.HTTPConnection
            self._open = kind(self._parts.hostname, self._parts.port, timeout=self._timeout)
            self._open.connect()
            if self._open.sock is not None:  # small packets go at once
                self._open.sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return self._open


def _cut(connection: http.client.HTTPConnection, late: threading.Event) -> None:
    """End a request whose time is over, whatever it waits for."""
    late.set()
    if connection.sock is not None:
        try:
            connection.sock.shutdown(socket.SHUT_RDWR)
        except OSError:
            return  # closed meanwhile


def _words(error: Exception) -> str:
    if isinstance(error, http.client.IncompleteRead):
        return "the connection broke off within an answer"
    if isinstance(error, http.client.HTTPException | ValueError):
        return f"no HTTP ({type(error).__name__})"
    return getattr(error, "strerror", None) or str(error) or type(error).__name__


def _excerpt(data: bytes) -> str:
    """Return what a server says is wrong: the `error` of a JSON object, else the beginning of the body."""
    text = data[:4096].decode("utf-8", "replace")
    try:
        said = json.loads(text)
        text = str(said.get("error", text)) if isinstance(said, dict) else text
    except (ValueError, RecursionError):
        pass
    return "".join(c if c.isprintable() else " " for c in " ".join(text.split()))[:LONGEST_EXCERPT]
