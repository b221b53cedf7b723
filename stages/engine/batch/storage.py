"""Artifacts of scenes in storage that workers share without a common file system: whatever fsspec reaches.

`<url>/<scene>/<step>/` holds what the run folder holds. As there, the manifest comes last, and a folder without a whole
one does not exist. A storage that answers late is given up on, never waited for without end.
"""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar
from uuid import uuid4

from scenewright.schemas.errors import MachineFailure, MissingDependency, ScenewrightError, UsageError
from scenewright.schemas.manifest import LARGEST_MANIFEST, MANIFEST_NAME, Manifest
from scenewright.stages.engine.batch.artifacts import manifests
from scenewright.stages.engine.batch.scene_log import clean

Value = TypeVar("Value")
HINT = "see [storage] in docs/BATCH.md"


def check_storage(url: str, timeout: float) -> None:
    """Write, read and remove a small file. Raises UsageError (no such kind of storage), MissingDependency,
    MachineFailure."""
    name, token = f".scenewright-{uuid4().hex}", uuid4().bytes

    def ask(files: Any, root: str) -> bytes:
        files.makedirs(root, exist_ok=True)
        files.pipe_file(f"{root}/{name}", token)
        try:
            return bytes(files.cat_file(f"{root}/{name}"))
        finally:
            files.rm_file(f"{root}/{name}")

    if _ask_storage(url, timeout, ask) != token:
        raise MachineFailure(f"{url}: gives back other bytes than were written there", hint=HINT)


def send(folder: Path, steps: Sequence[str], url: str, timeout: float) -> None:
    """Copy the artifacts of a run folder that are not there yet to `url`; each file may take `timeout` [s].

    Raises MachineFailure; what was half copied has no manifest.
    """
    for step, manifest in manifests(folder, steps).items():
        if stored_digest(url, step, timeout) == manifest.content_digest:
            continue

        def remove_manifest(files: Any, root: str, step: str = step) -> None:
            files.makedirs(f"{root}/{step}", exist_ok=True)
            if files.exists(f"{root}/{step}/{MANIFEST_NAME}"):
                files.rm_file(f"{root}/{step}/{MANIFEST_NAME}")

        _ask_storage(url, timeout, remove_manifest)
        for name in (*(file.path for file in manifest.files), MANIFEST_NAME):

            def put(files: Any, root: str, source: Path = folder / step / name, name: str = f"{step}/{name}") -> None:
                files.makedirs(f"{root}/{name}".rpartition("/")[0], exist_ok=True)
                files.put_file(str(source), f"{root}/{name}")

            _ask_storage(url, timeout, put)


def stored_digest(url: str, step: str, timeout: float) -> str | None:
    """Return the content digest of the artifact of a step that is stored under `url`; None when there is no whole one.

    The sizes of its files are looked at. Raises MachineFailure when the storage does not answer.
    """

    def look(files: Any, root: str) -> str | None:
        try:
            manifest = Manifest.model_validate_json(
                files.cat_file(f"{root}/{step}/{MANIFEST_NAME}", end=LARGEST_MANIFEST)
            )
            is_complete = all(files.size(f"{root}/{step}/{file.path}") == file.bytes for file in manifest.files)
        except (FileNotFoundError, NotADirectoryError, ValueError):
            return None
        return manifest.content_digest if is_complete else None

    return _ask_storage(url, timeout, look)


def drop_local(folder: Path, steps: Sequence[str]) -> None:
    """Remove the artifacts of a run folder; its log stays."""
    for step in steps:
        shutil.rmtree(folder / step, ignore_errors=True)


def _ask_storage(url: str, timeout: float, ask: Callable[[Any, str], Value]) -> Value:
    """Return what `ask(file system, root)` returns. It is left behind in its thread when it takes longer."""
    answer: list[Value] = []
    trouble: list[BaseException] = []

    def work() -> None:
        try:
            files, root = _open_file_system(url)
            answer.append(ask(files, root.rstrip("/")))
        except BaseException as error:  # noqa: BLE001 (raised below, in the thread that asked)
            trouble.append(error)

    thread = threading.Thread(target=work, daemon=True, name="storage")
    thread.start()
    thread.join(timeout)
    if answer:
        return answer[0]
    if not trouble:
        raise MachineFailure(f"{url}: the storage did not answer within {timeout:g} s", hint=HINT)
    error = trouble[0]
    if isinstance(error, ScenewrightError) or not isinstance(error, Exception):
        raise error
    # Every kind of storage has errors of its own.
    raise MachineFailure(f"{url}: {clean(f'{type(error).__name__}: {error}')}", hint=HINT) from None


def _open_file_system(url: str) -> tuple[Any, str]:
    from fsspec.core import url_to_fs
    from fsspec.registry import known_implementations

    try:
        return url_to_fs(url, use_listings_cache=False)
    except ImportError as error:
        raise MissingDependency(f"{url}: {clean(str(error))}", hint="install it on every node") from None
    except ValueError:
        kinds = ", ".join(sorted(known_implementations))
        raise UsageError(f"{url}: no kind of storage that fsspec knows", hint=f"it knows {kinds}") from None
