"""Who made an artifact, where, and what it cost."""

from __future__ import annotations

import platform
import resource
import subprocess
import sys
from datetime import UTC, datetime
from functools import cache

from scenewright.schemas.manifest import Provenance
from scenewright.schemas.places import HOME, checkout
from scenewright.stages.kit.digests import sha256_of_file
from scenewright.stages.kit.library_versions import library_version


@cache
def _git(*arguments: str) -> str:
    """Return what git says of the checkout; nothing where there is none, whatever repository lies around it."""
    folder = checkout()
    if folder is None or not (folder / ".git").exists():
        return ""
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *arguments], capture_output=True, text=True, timeout=10, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def peak_memory_bytes() -> int:
    """Return the peak resident memory of this process [bytes]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def processor_seconds() -> float:
    """Return the processor time so far of this process and of those that it has waited for, in all threads, with the
    loading of libraries [s]."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in used)


def provenance_now(command: tuple[str, ...], device: str, started: datetime) -> Provenance:
    """Record the command line, versions, platform, time since `started` and peak memory."""
    lock = HOME / "requirements.lock"
    return Provenance(
        command=command,
        package_version=library_version("scenewright"),
        git_commit=_git("rev-parse", "HEAD"),
        git_dirty=bool(_git("status", "--porcelain", "--untracked-files=no")),
        lock_digest=sha256_of_file(lock) if lock.exists() else "",
        platform=platform.platform(),
        python=platform.python_version(),
        device=device,
        started=started.isoformat(timespec="seconds"),
        seconds=round((datetime.now(UTC) - started).total_seconds(), 3),
        peak_memory_bytes=peak_memory_bytes(),
    )
