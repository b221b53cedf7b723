"""Commands in forks of a process that has everything imported: what a command line does, at a hundredth of its start.

A child gets limits of memory and time of its own, works in an empty folder, and ends with `os._exit` of the command's
code. (A case that fails is run again as a process of its own before it counts.)
"""

from __future__ import annotations

import contextlib
import importlib
import os
import pkgutil
import resource
import select
import signal
import sys
from dataclasses import dataclass
from pathlib import Path

CPU_SECONDS = 30
"""Processor time after which a command that was not asked for more work than usual hangs."""
LONG_CPU_SECONDS = 6
"""... and after which one is ended that was: what it goes on with is more of the same."""
WALL_SECONDS = 150
MEMORY_BYTES = 5 * 2**29
"""What a command may take: 2 GiB, and half of one for the libraries."""
ADDRESS_SPACE_BYTES = 6 * 2**30
"""What it can take at all: the machine is left working."""
LEFT_OUT = ("scenewright.stages.segment.networks", "scenewright.stages.segment.backends.huggingface")


@dataclass(frozen=True)
class Ended:
    """How a command ended."""

    code: int
    """Exit code; minus the signal's number where one ended it."""
    output: str
    error: str
    cpu_seconds: float
    memory_bytes: int
    """Resident at most, libraries included."""
    hung: bool = False


def import_everything() -> None:
    """Import the command line and every step's code, on one thread."""
    import scenewright.schemas
    import scenewright.stages
    from scenewright.cli.application import build_application

    build_application()
    for package in (scenewright.schemas, scenewright.stages):
        for entry in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not entry.name.startswith(LEFT_OUT):
                with contextlib.suppress(ImportError, SystemExit):
                    importlib.import_module(entry.name)
    import torch

    torch.set_num_threads(1)


def settle_environment() -> None:
    """Set what has to be set before libraries are loaded: one thread, and threads that a fork survives."""
    for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    os.environ["NUMBA_THREADING_LAYER"] = "workqueue"
    os.environ["COLUMNS"] = "120"


def _address_space() -> int:
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


def _child(words: list[str], folder: Path, scratch: Path, cpu_seconds: int) -> None:
    code = 70
    try:
        os.setsid()
        for descriptor, name in ((1, "stdout"), (2, "stderr")):
            file = os.open(scratch / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(file, descriptor)
            os.close(file)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        limit = _address_space() + ADDRESS_SPACE_BYTES
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        resource.setrlimit(resource.RLIMIT_CPU, (cpu_seconds, cpu_seconds + 10))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        os.chdir(folder)
        os.environ["HOME"] = os.environ["XDG_CACHE_HOME"] = os.environ["SCENEWRIGHT_CACHE"] = str(scratch / "home")
        sys.argv = ["scenewright", *words]
        sys.stdout = open(1, "w", closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", closefd=False)  # noqa: SIM115
        from scenewright.cli.main import main

        try:
            main()
            code = 0
        except SystemExit as ended:
            code = ended.code if isinstance(ended.code, int) else 0 if ended.code is None else 71
        sys.stdout.flush()
        sys.stderr.flush()
    except BaseException:
        import traceback

        with contextlib.suppress(BaseException):
            os.write(2, traceback.format_exc().encode("utf-8", "backslashreplace"))
        code = 72
    finally:
        os._exit(code)


def run(words: list[str], folder: Path, scratch: Path, cpu_seconds: int = CPU_SECONDS) -> Ended:
    """Run one command line in a fork, in the empty `folder`; its streams go to files in `scratch`."""
    for place in (folder, scratch, scratch / "home"):
        place.mkdir(parents=True, exist_ok=True)
    process = os.fork()
    if process == 0:
        _child(words, folder, scratch, cpu_seconds)
    handle = os.pidfd_open(process)
    try:
        ready, _, _ = select.select([handle], [], [], WALL_SECONDS)
    finally:
        os.close(handle)
    hung = not ready
    if hung:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process, signal.SIGKILL)
    _, status, used = os.wait4(process, 0)
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process, signal.SIGKILL)  # what it may have left behind
    code = os.waitstatus_to_exitcode(status)
    streams = [(scratch / name).read_bytes().decode("utf-8", "replace") for name in ("stdout", "stderr")]
    return Ended(
        code,
        streams[0],
        streams[1],
        used.ru_utime + used.ru_stime,
        used.ru_maxrss * 1024,
        hung or code in (-signal.SIGXCPU, -signal.SIGKILL),
    )
