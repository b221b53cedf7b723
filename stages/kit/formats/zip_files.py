"""Entries of zip files that nobody vouches for: what an entry claims is checked before memory is taken for it.

Nothing is ever unpacked to a path that an archive names: entries are asked for by names of ours.
"""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from scenewright.schemas.errors import BadInput

DEFLATE_LIMIT = 1032
"""Deflate never packs more than this many bytes into one."""
MOST_ENTRIES = 1_000_000
"""Most entries of a ZIP archive; a bound, by eye."""
_BROKEN = (zipfile.BadZipFile, zlib.error, struct.error, OSError, EOFError, ValueError, OverflowError, IndexError)
_UNSUPPORTED = (NotImplementedError, RuntimeError)
"""A compression or zip version that Python lacks; an encrypted entry."""


@contextmanager
def zip_errors(path: Path, hint: str) -> Iterator[None]:
    """Turn everything that reading a broken archive raises into BadInput naming the file."""
    try:
        yield
    except BadInput as error:
        raise BadInput(error.message if str(path) in error.message else f"{path}: {error.message}", hint=hint) from None
    except FileNotFoundError:
        raise BadInput(f"{path}: file is missing", hint=hint) from None
    except (*_BROKEN, *_UNSUPPORTED) as error:
        raise BadInput(f"{path}: {str(error) or type(error).__name__:.120}", hint=hint) from None


def find_entry(archive: zipfile.ZipFile, name: str, largest: int) -> zipfile.ZipInfo:
    """Return the entry of this name.

    Raises BadInput when there are several, when it is encrypted, or when it claims more bytes than `largest` or than
    can come out of what the file holds; KeyError when there is none.
    """
    entry = archive.getinfo(name)
    if len(archive.filelist) > MOST_ENTRIES:
        raise BadInput(f"{len(archive.filelist)} entries, at most {MOST_ENTRIES} are read")
    if len(archive.filelist) != len(archive.NameToInfo) and sum(e.filename == name for e in archive.filelist) > 1:
        raise BadInput(f"holds {name!r} more than once")
    if entry.flag_bits & 0x1:
        raise BadInput(f"{name} is encrypted")
    assert archive.fp is not None
    size = archive.fp.seek(0, 2)
    if entry.compress_size > size or entry.file_size > min(largest, DEFLATE_LIMIT * entry.compress_size + 1024):
        raise BadInput(f"{name} claims {entry.file_size} bytes out of {entry.compress_size} of a file of {size}")
    return entry
