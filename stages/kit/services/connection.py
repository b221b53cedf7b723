"""HTTP to a service: time-outs that hold for a whole answer, retries, errors in one line, a key that is never shown."""

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
from email.utils import parsedate_to_datetime
from urllib.parse import urlsplit

from scenewright.schemas.errors import BadInput, MachineFailure

RETRIED = frozenset({408, 425, 429, 500, 502, 503, 504})
"""Status codes of servers that are busy, starting or stumbling."""
LONGEST_WAIT = 30.0
"""Seconds between two tries, unless the client says otherwise."""
LARGEST_BODY = 64 * 2**20
"""Bytes of an answer, unless the client says otherwise."""
SHORTEST_SECRET = 8
"""Shortest secret that is hidden [characters]; shorter ones (`none`, `EMPTY`, which local servers accept) would be
hidden in the midst of words."""
HIDDEN = "[key]"
"""Stands where a service says the key back."""
LONGEST_EXCERPT = 200
"""Characters of a server's own words in an error."""

logger = logging.getLogger("scenewright")


@dataclass(frozen=True)
class Answer:
    """Body and content type of an answer with status 200."""

    body: bytes
    content_type: str


class TryAgain(Exception):
    """A fault that may pass; `wait` is what the server asks for [s], `status` its code when it gave one."""

    def __init__(self, reason: str, wait: float = 0.0, status: int | None = None) -> None:
        super().__init__(reason)
        self.wait, self.status = wait, status


class GivenUp(MachineFailure):
    """A fault that did not pass within the retries; `status` is the last code, None when there was none."""

    def __init__(self, message: str, *, status: int | None, hint: str = "") -> None:
        super().__init__(message, hint=hint)
        self.status = status


class Refused(BadInput):
    """A service understood and said no: `status`, and an `excerpt` of what it said."""

    def __init__(self, message: str, *, status: int, excerpt: str, hint: str = "") -> None:
        super().__init__(message, hint=hint)
        self.status, self.excerpt = status, excerpt


class Connection:
    """A connection to the service at `address` (http://HOST:PORT/PATH), kept open between requests.

    One answer may take `timeout` seconds, from the first byte sent to the last one received: a server that trickles is
    as late as one that is silent. Redirections and proxies are not followed. `sleep` waits between tries, `now` reads
    the clock [s since 1970] for servers that say until when.

    `key` goes into the Authorization header of every request and nowhere else: where the service says it back, HIDDEN
    stands instead in answers, errors and the log. Raises BadInput for a key that no header can hold. `repeats` counts
    the requests that were sent again.
    """

    def __init__(
        self,
        address: str,
        *,
        timeout: float,
        retries: int,
        retry_wait: float,
        key: str = "",
        refused_hint: str = "check the address",
        largest_body: int = LARGEST_BODY,
        longest_wait: float = LONGEST_WAIT,
        sleep: Callable[[float], None] = time.sleep,
        now: Callable[[], float] = time.time,
    ) -> None:
        if not (key.isascii() and key.isprintable() and " " not in key):
            raise BadInput("the key holds white space or other characters that no key has", hint="check the variable")
        self.address = address
        self.repeats = 0
        self._key, self._refused_hint, self._now = key, refused_hint, now
        self._largest_body, self._longest_wait = largest_body, longest_wait
        self._url = urlsplit(address)
        self._timeout, self._retries, self._retry_wait, self._sleep = timeout, retries, retry_wait, sleep
        self._open: http.client.HTTPConnection | None = None

    def get(self, path: str) -> Answer:
        """Return what the server answers. Raises GivenUp after the last try, Refused when it says no."""
        return self._patiently("GET", path, None, "", None)

    def post(
        self, path: str, body: bytes, content_type: str, *, judge: Callable[[Answer], None] | None = None
    ) -> Answer:
        """Send a body; otherwise as `get`. `judge` may raise TryAgain for an answer that cannot be used."""
        return self._patiently("POST", path, body, content_type, judge)

    def hide(self, text: str) -> str:
        """Return the text with HIDDEN where the key stands."""
        return text.replace(self._key, HIDDEN) if len(self._key) >= SHORTEST_SECRET else text

    def close(self) -> None:
        """Close the connection; the next request opens another one."""
        if self._open is not None:
            self._open.close()
        self._open = None

    def _patiently(
        self, method: str, path: str, body: bytes | None, content_type: str, judge: Callable[[Answer], None] | None
    ) -> Answer:
        for attempt in range(self._retries + 1):
            try:
                answer = self._once(method, path, body, content_type)
                if judge is not None:
                    judge(answer)
                return answer
            except BadInput:
                self.close()
                raise
            except TryAgain as error:
                self.close()
                reason, asked_wait, status = str(error), error.wait, error.status
            if attempt < self._retries:
                wait = min(self._longest_wait, max(asked_wait, self._retry_wait * 2**attempt))
                logger.warning(
                    "%s: %s; asked again in %g s (%d of %d)", self.address, reason, wait, attempt + 1, self._retries
                )
                self._sleep(wait)
                self.repeats += 1
        tries = f"{self._retries + 1} tries" if self._retries else "one try"
        raise GivenUp(
            f"{self.address}: {reason}, after {tries}", status=status, hint="see --request-timeout and --retries"
        )

    def _once(self, method: str, path: str, body: bytes | None, content_type: str) -> Answer:
        late = threading.Event()
        timer: threading.Timer | None = None
        reused = self._open is not None
        try:
            connection = self._connect()
            timer = threading.Timer(self._timeout, _cut, (connection, late))
            timer.daemon = True
            timer.start()
            headers = {"Accept": "application/json", "Connection": "keep-alive"}
            if self._key:
                headers["Authorization"] = f"Bearer {self._key}"
            if body is not None:
                headers["Content-Type"] = content_type
            connection.request(method, self._url.path + path, body, headers)
            response = connection.getresponse()
            data = self._read(response)
        except (OSError, http.client.HTTPException, ValueError) as error:
            if isinstance(error, ssl.SSLCertVerificationError):
                raise BadInput(f"{self.address}: {error.verify_message}", hint="check the certificate") from None
            if late.is_set() or isinstance(error, TimeoutError):
                raise TryAgain(f"no answer within {self._timeout:g} s") from None
            if reused and isinstance(error, ConnectionError):
                # Servers close connections that were idle for a while: not a fault, and not worth a wait.
                self.close()
                return self._once(method, path, body, content_type)
            raise TryAgain(_words(error)) from None
        finally:
            if timer is not None:
                timer.cancel()
        if late.is_set():
            raise TryAgain(f"no answer within {self._timeout:g} s")
        if len(self._key) >= SHORTEST_SECRET:
            data = data.replace(self._key.encode(), HIDDEN.encode())
        # Hidden once more, as escapes may have hidden the key among the bytes; before the words are cut.
        excerpt = _printable(self.hide(_own_words(data))) or _printable(self.hide(response.reason))
        if response.status in RETRIED:
            raise TryAgain(
                f"status {response.status} ({excerpt})",
                self._parse_retry_after(response.getheader("Retry-After", "")),
                response.status,
            )
        if response.status != 200:
            raise Refused(
                f"{self.address}{path}: status {response.status} ({excerpt})",
                status=response.status,
                excerpt=excerpt,
                hint=self._refused_hint,
            )
        return Answer(data, self.hide(response.getheader("Content-Type", "")))

    def _parse_retry_after(self, text: str) -> float:
        """Return the seconds of a Retry-After header, which holds a number or a date (RFC 9110, 10.2.3); else 0."""
        if text.isascii() and text.isdigit():
            return float(text[:9])
        try:
            return max(0.0, parsedate_to_datetime(text).timestamp() - self._now())
        except (ValueError, TypeError, OverflowError):
            return 0.0

    def _read(self, response: http.client.HTTPResponse) -> bytes:
        declared = response.getheader("Content-Length", "")
        length = int(declared[:20]) if declared.isascii() and declared.isdigit() else None
        largest = self._largest_body
        data = response.read(largest + 1) if length is None or length <= largest else b""
        if len(data) > largest or (length is not None and length > largest):
            raise BadInput(f"{self.address}: an answer of more than {largest} bytes", hint="mend the service")
        if length is not None and len(data) < length:
            raise http.client.IncompleteRead(data, length - len(data))
        return data

    def _connect(self) -> http.client.HTTPConnection:
        if self._open is None:
            assert self._url.hostname is not None
            kind = http.client.HTTPSConnection if self._url.scheme == "https" else http.client.HTTPConnection
            self._open = kind(self._url.hostname, self._url.port, timeout=self._timeout)
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


def _own_words(data: bytes) -> str:
    """Return what a service says is wrong: the `error` of a JSON object (its `message`), other JSON without escapes,
    else how the body begins."""
    try:
        reason = json.loads(data)
        for key in ("error", "message"):
            reason = reason.get(key, reason) if isinstance(reason, dict) else reason
        return reason if isinstance(reason, str) else json.dumps(reason, ensure_ascii=False)
    except (ValueError, RecursionError):
        return data[:4096].decode("utf-8", "replace")


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in " ".join(text.split()))[:LONGEST_EXCERPT]
