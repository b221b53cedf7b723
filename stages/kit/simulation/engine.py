"""pybullet, quiet, and with every client's parameters its own.

The library prints its build time and warnings to standard output, where data goes. And it keeps the distance at which
contacts break once for the process (`gContactBreakingThreshold`): a world that sets it changes every other world, those
made later too. `engine` is pybullet with that one parameter kept by client, and set before contacts are looked for.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

CONTACT_BREAKING = 0.02
"""Distance [m] at which contacts break in a world that sets none: the library's own."""


@contextmanager
def native_output_to_stderr() -> Iterator[None]:
    """Send what C code prints to standard output to standard error instead, afterwards and in whole lines."""
    library = ctypes.CDLL(None)
    sys.stdout.flush()
    library.fflush(None)
    saved = os.dup(1)
    with tempfile.TemporaryFile() as printed:
        try:
            os.dup2(printed.fileno(), 1)
            yield
        finally:
            library.fflush(None)
            os.dup2(saved, 1)
            os.close(saved)
            printed.seek(0)
            with contextlib.suppress(OSError):  # nobody may be there to be told
                for line in printed:
                    os.write(2, line if line.endswith(b"\n") else line + b"\n")


with native_output_to_stderr():
    import pybullet

_contact_breaking: dict[int, float] = {}
"""Client -> distance at which its contacts break [m], of those that set one."""


def _connect(*arguments: Any, **named: Any) -> int:
    client = int(pybullet.connect(*arguments, **named))
    _contact_breaking.pop(client, None)  # numbers of clients are used again
    return client


def _set_parameters(*, physicsClientId: int, **named: Any) -> None:
    if "contactBreakingThreshold" in named:
        _contact_breaking[physicsClientId] = named["contactBreakingThreshold"]
    pybullet.setPhysicsEngineParameter(**named, physicsClientId=physicsClientId)


def _step(*, physicsClientId: int) -> Any:
    _own_contact_breaking(physicsClientId)
    return pybullet.stepSimulation(physicsClientId)


def _detect_collisions(*, physicsClientId: int) -> Any:
    _own_contact_breaking(physicsClientId)
    return pybullet.performCollisionDetection(physicsClientId)


def _closest_points(*arguments: Any, physicsClientId: int, **named: Any) -> Any:
    _own_contact_breaking(physicsClientId)
    return pybullet.getClosestPoints(*arguments, physicsClientId=physicsClientId, **named)


def _own_contact_breaking(client: int) -> None:
    distance = _contact_breaking.get(client, CONTACT_BREAKING)
    pybullet.setPhysicsEngineParameter(contactBreakingThreshold=distance, physicsClientId=client)


engine = SimpleNamespace(
    **vars(pybullet)
    | {
        "connect": _connect,
        "setPhysicsEngineParameter": _set_parameters,
        "stepSimulation": _step,
        "performCollisionDetection": _detect_collisions,
        "getClosestPoints": _closest_points,
    }
)

__all__ = ["CONTACT_BREAKING", "engine", "native_output_to_stderr"]
