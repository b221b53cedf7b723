"""Process groups: how much memory one holds, and how to end it, all of it."""

from __future__ import annotations

import os
import signal
import time
from contextlib import suppress

import psutil

_PAUSE = 0.02
"""Time between two looks at a group that is being ended [s]."""


def descendants(pid: int) -> list[int]:
    """Return the process ids below `pid`, without itself.

    The kernel's own list of children costs microseconds; psutil reads the whole process table.
    """
    pids: list[int] = []
    waiting = [pid]
    while waiting:
        parent = waiting.pop()
        try:
            tasks = os.listdir(f"/proc/{parent}/task")
            texts = []
            for task in tasks:
                with open(f"/proc/{parent}/task/{task}/children") as file:
                    texts.append(file.read())
        except (FileNotFoundError, ProcessLookupError, PermissionError):
            if os.path.exists("/proc/self/task") and not os.path.exists(f"/proc/{parent}"):
                continue  # it ended in the meantime
            return _descendants_by_table(pid)
        children = [int(word) for text in texts for word in text.split()]
        pids += children
        waiting += children
    return pids


def _descendants_by_table(pid: int) -> list[int]:
    try:
        return [process.pid for process in psutil.Process(pid).children(recursive=True)]
    except psutil.Error:
        return []


def resident_memory(pid: int) -> int:
    """Return the resident memory of a process and all below it [bytes]; pages they share count for each."""
    total = 0
    for number in (pid, *descendants(pid)):
        try:
            total += psutil.Process(number).memory_info().rss
        except psutil.Error:
            continue
    return total


def created_at(pid: int) -> float | None:
    """Return when a process began [s since 1970], or None when there is none or it has ended."""
    try:
        process = psutil.Process(pid)
        return None if process.status() == psutil.STATUS_ZOMBIE else process.create_time()
    except psutil.Error:
        return None


def signal_group(group: int, number: int) -> None:
    """Send a signal to every process of a group, and to those that the leader started outside of it."""
    outside = [pid for pid in descendants(group) if _group_of(pid) != group]
    with suppress(ProcessLookupError, PermissionError):  # it has ended
        os.killpg(group, number)
    for pid in outside:
        with suppress(ProcessLookupError, PermissionError):
            os.kill(pid, number)


def _group_of(pid: int) -> int | None:
    try:
        return os.getpgid(pid)
    except ProcessLookupError:
        return None


def group_is_alive(group: int) -> bool:
    """Tell whether a process group has a member that has not ended."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    # A leader that nobody has waited for yet is a member too, though it has ended.
    return any(
        _group_of(process.pid) == group and process.info["status"] != psutil.STATUS_ZOMBIE
        for process in psutil.process_iter(["status"])
    )


def end_group(group: int, grace: float) -> None:
    """Ask a process group that is not our child to stop (SIGTERM); kill what is left after `grace` [s]."""
    signal_group(group, signal.SIGTERM)
    deadline = time.monotonic() + grace
    while group_is_alive(group) and time.monotonic() < deadline:
        time.sleep(_PAUSE)
    if group_is_alive(group):
        signal_group(group, signal.SIGKILL)
        while group_is_alive(group) and time.monotonic() < deadline + grace:
            time.sleep(_PAUSE)
