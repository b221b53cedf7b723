"""Commands in forked children of a process that holds the libraries: what `python -m MODULE WORD...` would do.

A new process loads numpy, numba and trimesh again, seconds of work; a fork shares them with its parent until it writes
to them. The parent has to have one thread and no CUDA. `run` forks its steps (chain.py), and a warm worker of a batch
its scenes (batch/warm_worker.py), whose children tell by name what they loaded on top, so that it can load that before
the next fork.
"""

from __future__ import annotations

import atexit
import gc
import importlib
import os
import runpy
import select
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import IO, BinaryIO, NoReturn

from scenewright.stages.engine import interruption
from scenewright.stages.engine.code import inherited

AT_WORK = 1.0
"""A child that runs for so long makes something [s]."""
NEXT = 2
"""Commands whose code is loaded ahead."""

_forks = False
_ahead: tuple[str, ...] = ()
_learned: BinaryIO | None = None
"""Where children of this process write the names of what they loaded; None where nobody asks."""


def forks() -> bool:
    """Tell whether this process runs commands in forks of itself, as what it forked does too."""
    return _forks


def begin(learned: BinaryIO) -> None:
    """Let this process run commands in forks of itself; they append to the unbuffered file `learned`."""
    global _forks, _learned
    _forks, _learned = True, learned


@contextmanager
def begun(ahead: Iterable[str]) -> Iterator[None]:
    """Let this process run commands in forks of itself inside.

    `ahead`: the module that each of them will load. While a long one works, those of the next ones are loaded here.
    """
    global _forks, _ahead
    forked, _forks, _ahead = _forks, True, tuple(ahead)
    try:
        yield
    finally:
        _forks, _ahead = forked, ()


def load_learned() -> None:
    """Load in this process what its children had to load, in their order."""
    assert _learned is not None
    _learned.seek(0)
    names = dict.fromkeys(_learned.read().decode().split())
    _learned.truncate(0)
    _load(names)


def _load_ahead(output: IO[str]) -> None:
    """Load what the next commands need, once a child is at work: one that finds all up to date ends before.

    No more than that: what is loaded here counts for the memory of every child that changes it.
    """
    global _ahead
    _ahead = _ahead[1:]
    if not _ahead or select.select([output], [], [], AT_WORK)[0]:
        return
    with interruption.waiting():
        _load(_ahead[:NEXT])


def _load(names: Iterable[str]) -> None:
    before = len(sys.modules)
    for name in names:
        with suppress(Exception):  # a child that needs it will say what is wrong
            importlib.import_module(name)
    if len(sys.modules) > before:
        gc.collect()
        gc.freeze()  # collections in the children then leave shared pages alone


def module_words(command: Sequence[str]) -> tuple[str, list[str]] | None:
    """Return module and words of a command `python -m MODULE WORD...` of this Python; None for another."""
    if len(command) < 3 or command[0] != sys.executable or command[1] != "-m":
        return None
    return command[2], list(command[3:])


def become(module: str, words: Sequence[str]) -> NoReturn:
    """Be `python -m module words` in this fork, and end it with its exit code."""
    before = set(sys.modules)
    inherited.note(before)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM, signal.SIGUSR1):
        signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)
    sys.argv = [module, *words]
    code = 0
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    except SystemExit as end:
        code = _exit_code(end)
    except BaseException:
        traceback.print_exc()
        code = 1
    with suppress(BaseException):  # whatever they do, the code stands
        _tell(before)
        threading._shutdown()  # type: ignore[attr-defined]
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code)


def _exit_code(end: SystemExit) -> int:
    if end.code is None or isinstance(end.code, int):
        return int(end.code or 0) & 0xFF
    sys.stderr.write(f"{end.code}\n")
    return 1


def _tell(before: set[str]) -> None:
    if _learned is None:
        return
    own_modules = [
        name
        for name, module in list(sys.modules.items())
        if name not in before and getattr(getattr(module, "__spec__", None), "name", None) == name
    ]
    _learned.write("".join(f"{name}\n" for name in own_modules).encode())


def run_forked(command: Sequence[str], environment: dict[str, str]) -> tuple[int, str]:
    """Run a command of this Python in a fork, with these variables set; return exit code and standard output.

    Raises KeyboardInterrupt as `subprocess` would, when the fork has ended.
    """
    module_and_words = module_words(command)
    assert module_and_words is not None, command
    sys.stdout.flush()
    sys.stderr.flush()
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.environ.update(environment)
        os.close(reading)
        os.dup2(writing, 1)
        os.close(writing)
        become(*module_and_words)
    os.close(writing)
    try:
        with open(reading, encoding="utf-8", errors="replace") as output:
            _load_ahead(output)
            text = output.read()
        return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), text
    except KeyboardInterrupt:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGTERM)
        os.waitpid(pid, 0)
        raise


class ForkedProcess:
    """A fork that leads a process group of its own, with the parts of `subprocess.Popen` that watching asks for."""

    def __init__(self, command: Sequence[str], log: int, environment: dict[str, str], closed: Sequence[int]) -> None:
        """Start a command of this Python with standard output and error in `log`; the descriptors `closed` are not
        for it."""
        self.returncode: int | None = None
        self.pid = os.fork()
        if self.pid:
            return
        try:
            os.setsid()
            nothing = os.open(os.devnull, os.O_RDONLY)
            for source, target in ((nothing, 0), (log, 1), (log, 2)):
                os.dup2(source, target)
            for descriptor in (nothing, log, *closed):
                os.close(descriptor)
            sys.stdin, sys.stdout, sys.stderr = (os.fdopen(n, mode) for n, mode in ((0, "r"), (1, "w"), (2, "w")))
            os.environ.update(environment)
            module_and_words = module_words(command)
            assert module_and_words is not None, command
            become(*module_and_words)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(1)

    def wait(self) -> int:
        """Wait for its end and return its status as `subprocess` does."""
        if self.returncode is None:
            self.returncode = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        return self.returncode


Process = subprocess.Popen[bytes] | ForkedProcess
