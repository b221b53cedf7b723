"""Batches made ahead of their use by other processes, in the order in which they were asked for."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, TypeVar

Made = TypeVar("Made")
AHEAD = 3
"""Batches under way for each process."""
_MAKE: list[Callable[..., Any]] = []
"""What a process of the pool makes batches with: given once, not with every order."""


def fed(make: Callable[..., Made], orders: Iterator[tuple[Any, ...]], workers: int) -> Generator[Made, None, None]:
    """Yield make(*order) of every order; with `workers`, which need `make` to be picklable, ahead of time."""
    if workers == 0:
        yield from (make(*order) for order in orders)
        return
    with ProcessPoolExecutor(workers, get_context("spawn"), initializer=_keep, initargs=(make,)) as pool:
        under_way: deque[Future[Made]] = deque()
        for order in orders:
            under_way.append(pool.submit(_made, order))
            if len(under_way) >= AHEAD * workers:
                yield under_way.popleft().result()
        while under_way:
            yield under_way.popleft().result()


def _keep(make: Callable[..., Any]) -> None:
    _MAKE[:] = [make]


def _made(order: tuple[Any, ...]) -> Any:
    return _MAKE[0](*order)
