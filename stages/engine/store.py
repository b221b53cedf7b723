"""Artifact folders that appear whole or not at all.

A run holds an exclusive lock beside its target, writes into a partial folder beside it, and takes the target's place
in one step: renameat2(RENAME_EXCHANGE) where the file system has it, otherwise a journalled pair of renames that the
next run (or reader) completes. Leftovers of killed runs are swept by the next run, as only the holder of the lock may
own a partial folder.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import fcntl
import json
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path

from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput, MachineFailure, UsageError
from scenewright.schemas.manifest import LARGEST_MANIFEST, MANIFEST_NAME
from scenewright.schemas.outside import file_content, json_of

LARGEST_JOURNAL = 2**20
"""Largest journal [bytes]."""
AT_FDCWD = -100
"""Linux: paths are relative to the working directory (fcntl.h)."""
RENAME_EXCHANGE = 2
"""Linux: flag of renameat2 that lets two names change places (fs.h)."""
TIMINGS_NAME = "timings.json"
"""The runner writes it into every artifact."""
MOST_BY_ONE = 50
"""Files of an artifact that are flushed to the disk one by one."""


def _beside(target: Path, suffix: str) -> Path:
    return target.with_name(f".{target.name}.{suffix}")


def _ours(target: Path) -> re.Pattern[str]:
    """Names of what a run leaves beside its target, letter by letter: it may be called `run[1]` or `*`."""
    return re.compile(re.escape(f".{target.name}.") + r"(partial-\d+|old)-[0-9a-f]{8}")


def sync_folder(path: Path) -> None:
    """Flush a folder's entries to the disk."""
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def sync_tree(root: Path) -> None:
    """Flush every file and folder under `root` to the disk; many of them by flushing all of the file system at once, as
    each by itself waits for the disk."""
    if sum(len(names) for _, _, names in os.walk(root)) > MOST_BY_ONE and _sync_file_system(root):
        return
    for folder, _, names in os.walk(root):
        for name in names:
            descriptor = os.open(os.path.join(folder, name), os.O_RDONLY)
            try:
                os.fsync(descriptor)
            finally:
                os.close(descriptor)
        sync_folder(Path(folder))


def _sync_file_system(root: Path) -> bool:
    """Flush the file system of `root`. Returns False where the kernel cannot, or says that it failed."""
    descriptor = os.open(root, os.O_RDONLY | os.O_DIRECTORY)
    try:
        return bool(ctypes.CDLL(None, use_errno=True).syncfs(descriptor) == 0)
    except (OSError, AttributeError):
        return False
    finally:
        os.close(descriptor)


def exchange(first: Path, second: Path) -> bool:
    """Swap two paths atomically. Returns False where the kernel or the file system cannot."""
    try:
        renameat2 = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError):
        return False
    result = renameat2(AT_FDCWD, os.fsencode(first), AT_FDCWD, os.fsencode(second), RENAME_EXCHANGE)
    if result == 0:
        return True
    code = ctypes.get_errno()
    if code in (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP):
        return False
    raise OSError(code, os.strerror(code), str(second))


def _replace_by_journal(partial: Path, target: Path) -> None:
    journal, aside = _beside(target, "journal"), _beside(target, f"old-{secrets.token_hex(4)}")
    text = json.dumps({"partial": partial.name, "old": aside.name})
    with journal.open("w") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    sync_folder(target.parent)
    os.rename(target, aside)
    os.rename(partial, target)
    sync_folder(target.parent)
    journal.unlink()
    shutil.rmtree(aside, ignore_errors=True)


def recover(target: Path) -> None:
    """Complete or undo a replacement that a kill interrupted. Call with the lock held."""
    journal = _beside(target, "journal")
    if not os.path.lexists(journal):
        return
    text = file_content(journal, LARGEST_JOURNAL, hint="no journal of ours; move it away")
    try:
        plan = json_of(text, str(journal))
        if not all(_ours(target).fullmatch(plan[role]) for role in ("partial", "old")):
            raise ValueError("names what is not ours")
        partial, aside = (target.with_name(plan[role]) for role in ("partial", "old"))
    except (BadInput, ValueError, TypeError, KeyError):
        journal.unlink()  # killed while writing it: nothing had been renamed yet
        return
    if not target.exists():
        if (partial / MANIFEST_NAME).exists():
            os.rename(partial, target)
        elif aside.exists():
            os.rename(aside, target)
    sync_folder(target.parent)
    journal.unlink()


def sweep(target: Path) -> None:
    """Remove what killed runs left beside `target`. Call with the lock held: only its holder owns such folders."""
    ours = _ours(target)
    with contextlib.suppress(OSError):
        for leftover in [entry.path for entry in os.scandir(target.parent) if ours.fullmatch(entry.name)]:
            shutil.rmtree(leftover, ignore_errors=True)


@contextlib.contextmanager
def locked(target: Path) -> Iterator[None]:
    """Hold the lock of `target`. Raises MachineFailure when another run holds it."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(_beside(target, "lock"), os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        reason = "a file stands in its path" if isinstance(error, NotADirectoryError | FileExistsError) else ""
        raise MachineFailure(f"{target}: {reason or error.strerror}", hint="choose another --out") from None
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise MachineFailure(
                f"{target}: another run is writing it", hint="wait for it to end, or choose another --out"
            ) from None
        recover(target)
        sweep(target)
        yield
    finally:
        os.close(descriptor)


def complete_interrupted(target: Path) -> None:
    """For readers: complete an interrupted replacement, if there is one and nobody is at it."""
    if target.name and os.path.exists(_beside(target, "journal")):
        with contextlib.suppress(MachineFailure, OSError), locked(target):  # a reader may not be allowed to
            pass


def check_target(target: Path, kind: str) -> None:
    """Refuse to replace what is no artifact, or one of another kind. Raises UsageError."""
    if not target.exists():
        return
    if not target.is_dir():
        raise UsageError(f"{target}: a file stands there", hint="choose another --out")
    manifest = target / MANIFEST_NAME
    if manifest.exists():
        kind_there = _kind_on_disk(manifest)
        if kind_there is None and not (target / TIMINGS_NAME).exists():
            raise UsageError(f"{target}: its {MANIFEST_NAME} is not one that a step wrote", hint="choose another --out")
        if kind_there not in (None, kind):
            raise UsageError(f"{target}: holds a {kind_there!r} artifact, not {kind!r}", hint="choose another --out")
    elif any(target.iterdir()):
        raise UsageError(f"{target}: holds files that no step wrote", hint="choose another --out; nothing was changed")


def _kind_on_disk(manifest: Path) -> str | None:
    """Return the kind that a manifest states, or None when it is torn."""
    try:
        return str(json_of(file_content(manifest, LARGEST_MANIFEST), str(manifest))["kind"])
    except (BadInput, TypeError, KeyError):
        return None


@contextlib.contextmanager
def partial_folder(target: Path) -> Iterator[Path]:
    """Yield a new partial folder beside `target` (lock held by the caller); whatever is left of it is removed.

    Raises MachineFailure when it cannot be made.
    """
    partial = _beside(target, f"partial-{os.getpid()}-{secrets.token_hex(4)}")
    try:  # around its making too: a signal may arrive in between
        try:
            partial.mkdir()
        except OSError as error:
            raise MachineFailure(f"{target}: {error.strerror}", hint="choose another --out") from None
        yield partial
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def kept_folder(target: Path, key: str, *, fresh: bool) -> Path:
    """Return the folder beside `target` in which a run of this key keeps its state (lock held by the caller). What runs
    of other keys left is removed, and with `fresh` what this one left."""
    folder = _beside(target, f"kept-{key[:16]}")
    forget_kept(target, None if fresh else folder)
    return folder


def forget_kept(target: Path, but: Path | None = None) -> None:
    """Remove what runs of `target` kept, but one folder."""
    pattern = re.compile(re.escape(f".{target.name}.") + r"kept-[0-9a-f]{16}")
    for entry in target.parent.iterdir():
        if pattern.fullmatch(entry.name) and entry != but:
            shutil.rmtree(entry, ignore_errors=True)


def take_place(partial: Path, target: Path) -> None:
    """Make the finished partial folder stand at `target`, in one step."""
    sync_tree(partial)
    if not target.exists():
        os.rename(partial, target)
    elif not exchange(partial, target):
        _replace_by_journal(partial, target)
    sync_folder(target.parent)


def replace_document(document: Model, path: Path) -> None:
    """Write a JSON document in place of another, whole or not at all. It is written beside the file's folder first, so
    that no artifact holds a file that its manifest does not list."""
    partial = path.parent.parent / f".{path.parent.name}.{path.name}-{os.getpid()}"
    try:
        document.write(partial)
        with partial.open("rb") as file:
            os.fsync(file.fileno())
        partial.replace(path)
        sync_folder(path.parent)
    finally:
        partial.unlink(missing_ok=True)
