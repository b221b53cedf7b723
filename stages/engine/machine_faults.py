"""Which errors are the machine's: a full or forbidden disk, exhausted memory. All others are the input's or ours."""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Iterable

MACHINE_ERRORS = (
    *(errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG, errno.EIO, errno.EACCES, errno.EPERM, errno.ENAMETOOLONG),
    *(errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENXIO, errno.ENODEV, errno.ESTALE, errno.ETIMEDOUT, errno.EMLINK),
)
"""What the system says when the fault is neither the input's nor ours."""
PLACE_ERRORS = (errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.EEXIST, errno.ENOTEMPTY, errno.ELOOP, errno.EBUSY)
"""What it says of a place that is not as expected: the user's fault where the user named the place, else ours."""
OUT_OF_MEMORY = re.compile(
    r"failed to map segment|annot allocate memory|can't allocate memory|out of memory|bad_alloc|Insufficient memory"
    r"|Unable to allocate|can't start new thread",
    re.IGNORECASE,
)


def first_cause(error: OSError) -> tuple[int | None, str]:
    """Return number and words of what the system said; copying a folder gathers them as text."""
    if error.errno is None and (match := re.search(r"\[Errno (\d+)\] ([^:\"']+)", str(error))):
        return int(match[1]), match[2]
    return error.errno, error.strerror or str(error)


def is_machines(error: OSError | MemoryError, words: Iterable[str]) -> bool:
    """Whether an error that nobody expected is the machine's; `words` are those of the command line.

    A file that is missing where no word of the command line points is one that the program should have made or told of.
    """
    if isinstance(error, MemoryError):
        return True
    number, _ = first_cause(error)
    if number in MACHINE_ERRORS:
        return True
    return number in PLACE_ERRORS and any(_names(word, name) for name in _places(error) for word in words)


def _places(error: OSError) -> list[str]:
    names = [name for name in (error.filename, error.filename2) if isinstance(name, str | bytes | os.PathLike)]
    return [os.path.abspath(os.fsdecode(name)) for name in names if "\0" not in os.fsdecode(name)]


def _names(word: str, path: str) -> bool:
    """Whether a word of the command line is this place, or a folder above or below it."""
    value = word.partition("=")[2] if word.startswith("--") and "=" in word else word
    if not value or value.startswith("-") or "\0" in value:
        return False
    absolute = os.path.abspath(value)
    return (
        absolute == path or path.startswith(absolute.rstrip("/") + "/") or absolute.startswith(path.rstrip("/") + "/")
    )
