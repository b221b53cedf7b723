"""Replies of services, kept by what was asked of whom, so that a run that broke off goes on where it stopped.

`$SCENEWRIGHT_REPLIES`, else `$XDG_CACHE_HOME/scenewright/replies`, else `~/.cache/scenewright/replies`. A file is there
whole or not at all, is judged like a reply when it is read, and can be deleted at any time.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import secrets
from pathlib import Path

ENVIRONMENT = "SCENEWRIGHT_REPLIES"
LARGEST_CACHE = 2**30
"""Most bytes of the cache; the oldest files go first."""

logger = logging.getLogger("scenewright")


def cache_folder() -> Path:
    """Return the folder; it need not exist yet."""
    environment_value = os.environ.get(ENVIRONMENT)
    if environment_value:
        return Path(environment_value)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "scenewright" / "replies"


class ReplyCache:
    """The replies of one service, known by its identity (not by its address).

    `read_only_new` leaves what is there unread (`--force`) and still keeps what comes. A folder that cannot be written
    costs a warning, not the run.
    """

    def __init__(self, identity: str, *, read_only_new: bool = False) -> None:
        self.folder = cache_folder() / hashlib.sha256(identity.encode()).hexdigest()[:32]
        self._ignores = read_only_new
        self._broken = False

    def find(self, request: bytes) -> bytes | None:
        """Return the body of the reply to a request, or None."""
        if self._ignores:
            return None
        with contextlib.suppress(OSError):
            return self._path(request).read_bytes()
        return None

    def keep(self, request: bytes, reply: bytes) -> None:
        """Keep the body of a reply that was found sound."""
        if self._broken:
            return
        path = self._path(request)
        partial = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            try:
                partial.write_bytes(reply)
                os.replace(partial, path)
            finally:
                partial.unlink(missing_ok=True)
        except OSError as error:
            self._broken = True
            logger.warning("%s: %s: replies are not kept, a run that breaks off starts over", path, error.strerror)

    def _path(self, request: bytes) -> Path:
        return self.folder / f"{hashlib.sha256(request).hexdigest()}.json"


def prune(limit: int = LARGEST_CACHE) -> None:
    """Delete the oldest replies until no more than `limit` bytes are left."""
    files = []
    for path in cache_folder().glob("*/*"):
        with contextlib.suppress(OSError):
            status = path.stat()
            files.append((status.st_mtime_ns, status.st_size, path))
    total = sum(size for _, size, _ in files)
    for _, size, path in sorted(files):
        if total <= limit:
            return
        with contextlib.suppress(OSError):
            path.unlink()
            total -= size
