"""Work of one thread beside that of another: what comes next is read while what came is used."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
_END = object()


def prefetched(items: Iterable[Item], ahead: int = 2) -> Iterator[Item]:
    """Yield the items, which a thread makes up to `ahead` before they are asked for, one after the other.

    What making an item raises is raised in its place. Nothing else may use what the items are made from meanwhile.
    """
    source = iter(items)
    with ThreadPoolExecutor(1, thread_name_prefix="prefetch") as thread:
        waiting: deque[Future[object]] = deque(thread.submit(next, source, _END) for _ in range(ahead))
        while (item := waiting.popleft().result()) is not _END:
            waiting.append(thread.submit(next, source, _END))
            yield item  # type: ignore[misc]
