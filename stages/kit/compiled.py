"""Functions that numba compiles, and keeps compiled until they or what they took from other files changes.

Functions and numbers of other files are compiled into the function that uses them, and numba asks a function's own
file alone whether what it kept is stale. The key of an artifact knows the other files (stages/engine/code), so what it
names must be what runs.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, TypeVar, overload

import numpy as np
from numba import njit
from numba.core import caching, config, event
from numba.core.dispatcher import Dispatcher
from scenewright.stages.kit.progress import shown

Function = TypeVar("Function", bound=Callable[..., Any])

_ours: set[Any] = set()
"""Python functions whose compiled code is kept by what they hold."""


@overload
def compiled(function: Function, /) -> Function: ...
@overload
def compiled(*signatures: object, **options: Any) -> Callable[[Function], Function]: ...
def compiled(*signatures: Any, **options: Any) -> Any:
    """Return what `numba.njit` makes of a function, kept on disk: `@compiled` or `@compiled(parallel=True)`.

    Compiled code is kept in NUMBA_CACHE_DIR where that is set, else beside the function's file, else in the user's
    cache. Raises RuntimeError where none of them can be written.
    """

    def compile_function(function: Callable[..., Any]) -> Any:
        _ours.add(function)
        return njit(*signatures, cache=True, **options)(function)  # type: ignore[call-overload]

    if len(signatures) == 1 and callable(signatures[0]) and not options:
        function, signatures = signatures[0], ()
        return compile_function(function)
    return compile_function


def source_stamp(names: dict[str, Any]) -> bytes:
    """Return a digest of what decides the compiled code of a module's functions, by the module's names: its source and
    those of the modules whose compiled functions it holds, and the numbers that it and they hold."""
    digest = hashlib.sha256()
    for file, held in sorted(_modules(names, {}).items()):
        digest.update(hashlib.sha256(Path(file).read_bytes()).digest())
        for name in sorted(held):
            digest.update(f"{name}={_number(held[name])!r};".encode())
    return digest.digest()


def _modules(names: dict[str, Any], known: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Add a module and those whose compiled functions it holds to what is known: file -> names."""
    if names["__file__"] not in known:
        known[names["__file__"]] = names
        for value in list(names.values()):
            if isinstance(value, Dispatcher):
                _modules(value.py_func.__globals__, known)
    return known


def _number(value: Any) -> Any:
    """Return what is compiled in of a number, text, array or a tuple of them; None for anything else."""
    if isinstance(value, np.ndarray):
        return str(value.dtype), value.shape, hashlib.sha256(value.tobytes()).hexdigest()
    if isinstance(value, tuple):
        return tuple(map(_number, value))
    return value if isinstance(value, bool | int | float | complex | str | bytes | np.generic) else None


class _ByWhatItHolds:
    """A place for compiled code whose stamp is `source_stamp`."""

    def __init__(self, function: Any, file: str) -> None:
        super().__init__(function, file)  # type: ignore[call-arg]
        self._names = function.__globals__

    def get_source_stamp(self) -> bytes:
        return source_stamp(self._names)

    @classmethod
    def from_function(cls, function: Any, file: str) -> Any:
        return super().from_function(function, file) if function in _ours else None  # type: ignore[misc]


class InGivenFolder(_ByWhatItHolds, caching.UserProvidedCacheLocator):  # type: ignore[misc]
    """NUMBA_CACHE_DIR."""


class BesideTheFile(_ByWhatItHolds, caching.InTreeCacheLocator):  # type: ignore[misc]
    """`__pycache__` beside the function's file."""


class InUserCache(_ByWhatItHolds, caching.UserWideCacheLocator):  # type: ignore[misc]
    """numba's folder in the user's cache."""


class _ShowsCompilation(event.Listener):  # type: ignore[misc]
    """Tells the progress of what goes on; a function that another one waits for is part of that one."""

    def __init__(self) -> None:
        self._open: list[ExitStack] = []

    def on_start(self, _: Any) -> None:
        self._open.append(ExitStack())
        if len(self._open) == 1:
            self._open[0].enter_context(shown().compiling())

    def on_end(self, _: Any) -> None:
        self._open.pop().close()


class _KeptFiles(caching.IndexDataCacheFile):  # type: ignore[misc]
    """numba's files of kept code. One that is torn, or speaks of a class that has since moved, is as if it were not
    there; numba would end the program."""

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except Exception:
            return {}

    def _load_data(self, name: str) -> Any:
        try:
            return super()._load_data(name)
        except Exception as error:
            raise FileNotFoundError(name) from error  # which numba takes for code that is not kept


caching.IndexDataCacheFile = _KeptFiles  # type: ignore[misc]
event.register("numba:compile", _ShowsCompilation())
if not config.CACHE_LOCATOR_CLASSES:  # type: ignore[attr-defined]
    config.CACHE_LOCATOR_CLASSES = ",".join(  # type: ignore[attr-defined]
        [f"{place.__module__}.{place.__name__}" for place in (InGivenFolder, BesideTheFile, InUserCache)]
        + [place.__name__ for place in caching.CacheImpl._locator_classes]  # of everybody else's functions
    )
