"""The digest of a step's code, kept in the user's cache until a file or folder that it was read from changes.

Reading takes .2 to 1 s a step, asking the cache a few milliseconds. A process reads a step once: what it has loaded
does not change with the files. Where the cache cannot be written the code is read each time.
"""

from __future__ import annotations

import json
import os
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from scenewright.schemas.errors import MachineFailure
from scenewright.schemas.plugins import plugins
from scenewright.stages.engine.code import inherited
from scenewright.stages.engine.code.places import OURS, added_folders, places_here
from scenewright.stages.engine.code.program import Code, Definition, Program, Whole
from scenewright.stages.engine.discovery import package_of
from scenewright.stages.engine.user_cache import cache_folder
from scenewright.stages.kit.digests import sha256_of_text
from scenewright.stages.kit.stage import Stage

FORMAT = 1
"""Number of the form of the cache's files, and of how code is read: raised with either."""
SETTLED_SECONDS = 0.1
"""Age below which a file may be written again without another time stamp [s]; file systems count in ticks of 4 ms."""
MOST_TREES = 8
"""Checkouts and installations whose answers are kept; the one that was asked for longest ago goes first."""

Added = tuple[tuple[str, tuple[str, ...]], ...]
"""Packages and their folders, of those that this process gave more than their own."""
MOST_EARLIER = 4
"""Codes of a step that were seen before, by which a change is named."""

Stamp = list[int]
"""Size, time of the last write and of the last change of any kind [ns]."""


def step_code(stage: Stage) -> Code:
    """Return the code of a step: what its `run` and the class of its parameters reach.

    Raises KeyError where the step's module defines no `run`, MachineFailure where this fork holds older code.
    """
    code = code_of(*_roots_of(stage))
    inherited.refuse_edited(code.modules)
    return code


def changed_modules(stage: Stage, before: str) -> list[str]:
    """Return the modules whose code differs from that of an earlier digest of the step, or is gone; one that only moved
    is none of them. Empty where that code was not seen here lately."""
    code = step_code(stage)
    roots = _roots_of(stage)
    modules = _kept(_question(roots, _followed(roots), added_folders())).get("earlier", {}).get(before, {})
    if not modules:
        return []
    new, gone = (
        Counter(code.modules.values()) - Counter(modules.values()),
        Counter(modules.values()) - Counter(code.modules.values()),
    )
    differing = {name for name, digest in code.modules.items() if digest in new}
    return sorted(differing | {name for name, digest in modules.items() if digest in gone})


def _roots_of(stage: Stage) -> tuple[str, str]:
    run = f"{package_of(stage)}.{stage.module}:run"
    return run, f"{stage.parameters.__module__}:{stage.parameters.__name__}"


def code_of(*roots: str, also: tuple[str, ...] = ()) -> Code:
    """Return the code that definitions reach, each given as `module:name`, or a whole module as `module:`.

    What is followed is scenewright, the packages at the top of these, and those that `also` names. Raises KeyError for
    one that is not there.
    """
    return _code_of(roots, _followed(roots, also), added_folders())


@cache
def _code_of(roots: tuple[str, ...], also: tuple[str, ...], added: Added) -> Code:
    question = _question(roots, also, added)
    kept = _read_kept(question)
    if kept is not None:
        return kept
    program = _program(also, added)
    before = time.time()
    pairs = [root.split(":") for root in roots]
    code = program.code_of([Definition(module, name) if name else Whole(module) for module, name in pairs])
    _keep(question, program, code, before)
    return code


def _question(roots: Sequence[str], also: Sequence[str], added: Added) -> list[str]:
    """What is asked of the code as it lies on the disk: definitions, packages and folders."""
    return [*roots, *also, *(f"{name}={folder}" for name, folders in added for folder in folders)]


def _followed(roots: Sequence[str], also: Sequence[str] = ()) -> tuple[str, ...]:
    """Packages at the top that are followed beside scenewright."""
    return tuple(sorted({*also, *(root.partition(".")[0] for root in roots)} - {OURS}))


@cache
def _program(also: tuple[str, ...], added: Added) -> Program:
    """One for all steps of a process: they share most modules. `added` is what it would otherwise not notice."""
    return Program(places_here(_plugins(), also))


@cache
def _plugins() -> Mapping[str, Sequence[str]]:
    """Group of entry points -> modules that installed distributions declare in it."""
    modules: dict[str, list[str]] = {}
    for plugin in plugins():
        modules.setdefault(plugin.group, []).append(plugin.module)
    return modules


def _file_of(question: Sequence[str]) -> Path | None:
    """Where the answer to a question about this tree is kept."""
    tree = sha256_of_text(json.dumps([FORMAT, str(Path(__file__).resolve()), _plugins()]))[:16]
    try:
        return cache_folder("code") / tree / f"{sha256_of_text(json.dumps(question))[:16]}.json"
    except MachineFailure:
        return None


def _kept(question: Sequence[str]) -> dict[str, Any]:
    """What is kept of a question, whether it is still true or not; empty where nothing is."""
    path = _file_of(question)
    with suppress(OSError, ValueError):
        kept = json.loads(path.read_text(encoding="utf-8")) if path else {}
        if isinstance(kept, dict) and kept.get("question") == question:
            return kept
    return {}


def _read_kept(question: Sequence[str]) -> Code | None:
    """Return the kept answer where every file and folder is as it was."""
    kept = _kept(question)
    try:
        if any(_stamp(file) != stamp for file, stamp in kept["files"].items()):
            return None
        if any(_names(folder) != names for folder, names in kept["folders"].items()):
            return None
        return Code(kept["digest"], kept["modules"], frozenset(kept["texts"]))
    except (OSError, KeyError, TypeError, AttributeError):
        return None


def _keep(question: Sequence[str], program: Program, code: Code, before: float) -> None:
    """Keep an answer, whole or not at all, unless a file is too young to be told from a later one."""
    path = _file_of(question)
    if path is None:
        return
    with suppress(OSError):
        files = {str(file): _stamp(str(file)) for file in sorted(program.places.files)}
        if any(stamp[2] / 1e9 > before - SETTLED_SECONDS for stamp in files.values()):
            return
        old = _kept(question)
        earlier = old.get("earlier", {}) | ({old["digest"]: old["modules"]} if "digest" in old else {})
        content = {
            "question": question,
            "earlier": dict(list(earlier.items())[-MOST_EARLIER:]),
            "digest": code.digest,
            "modules": code.modules,
            "texts": sorted(code.texts),
            "files": files,
            "folders": {str(folder): _names(str(folder)) for folder in sorted(program.places.folders)},
        }
        path.parent.mkdir(parents=True, exist_ok=True)
        os.utime(path.parent)
        partial = path.with_suffix(f".{os.getpid()}")
        partial.write_text(json.dumps(content), encoding="utf-8")
        partial.replace(path)
        _forget_old_trees(path.parent.parent)


def _forget_old_trees(folder: Path) -> None:
    trees = sorted((tree for tree in folder.iterdir() if tree.is_dir()), key=lambda tree: tree.stat().st_mtime)
    for tree in trees[:-MOST_TREES]:
        for file in tree.iterdir():
            file.unlink(missing_ok=True)
        tree.rmdir()


def _stamp(file: str) -> Stamp:
    found = os.stat(file)
    return [found.st_size, found.st_mtime_ns, found.st_ctime_ns]


def _names(folder: str) -> str:
    """What modules and packages a folder holds, as one line; caches of compiled code are none."""
    with os.scandir(folder) as entries:
        return " ".join(sorted(e.name for e in entries if e.name.endswith(".py") or _is_package(e)))


def _is_package(entry: os.DirEntry[str]) -> bool:
    return "." not in entry.name and entry.name != "__pycache__" and entry.is_dir()
