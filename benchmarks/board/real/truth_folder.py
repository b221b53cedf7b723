"""A log with a truth that somebody measured: the folder of docs/DATA.md, read as what comes from outside."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput
from scenewright.schemas.hand_written import LARGEST_LENGTH, UprightBox
from scenewright.schemas.vocabulary import UNNAMED
from scenewright.stages.engine.discovery import stage_by_name
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.labels import class_of_word, plain

from benchmarks.board.real.logs import Log

FORM = "docs/DATA.md shows the form"
LARGEST_FILE = 4 * 2**20
"""Most bytes of truth.json."""
MOST_POINTS = 20_000_000
MOST_INSTANCES = 10_000
Identity = Annotated[int, Field(ge=1, le=2**31 - 1)]
Bounds = Literal["floor", "wall", "ceiling"]


class Instance(Model):
    """One thing of the room."""

    id: Identity
    """As in `instance` of truth.npz."""
    word: str = Field(alias="class", min_length=1, max_length=60)
    """What it is called: a class of the vocabulary, one of its synonyms, or any other word."""
    support: Identity | Bounds | None = None
    """What carries it, by id, or what bounds the room; None: not known."""
    box: UprightBox | None = None
    """Around the whole thing, in the log's world; without one that of its points."""


class TruthFile(Model):
    """truth.json."""

    instances: tuple[Instance, ...] = Field(min_length=1, max_length=MOST_INSTANCES)
    complete: bool = False
    """Whether points without an instance show what is no thing (floor, walls), so that a thing found there is false."""
    ingest: dict[Annotated[str, Field(pattern=r"^[a-z][a-z_]{0,39}$")], bool | int | float | str] = Field(
        {}, max_length=40
    )
    """Options of `ingest` for this log, as in a config file: {"every": 2, "fx": 525.0}."""


@dataclass(frozen=True)
class Told:
    """What a folder holds."""

    log: Log
    file: TruthFile
    points: np.ndarray
    """(N, 3) float [m] in the log's world."""
    owner: np.ndarray
    """(N,) int id of the thing of each, 0 none."""

    @property
    def unknown_words(self) -> tuple[str, ...]:
        """Words that are no class of ours, in order."""
        return tuple(sorted({entry.word for entry in self.file.instances if is_unknown(entry.word)}))


def is_unknown(word: str) -> bool:
    """Whether a word is neither a class nor a synonym of one."""
    return class_of_word(word) == UNNAMED and plain(word) != UNNAMED


def read_truth(folder: Path) -> Told:
    """Read and check a folder. Raises BadInput, naming the file, what is wrong with it and what to do."""
    if not folder.is_dir():
        raise BadInput(f"{folder}: no folder", hint=FORM)
    for name in ("truth.json", "truth.npz"):
        if not (folder / name).is_file():
            raise BadInput(f"{folder}: holds no {name}", hint=FORM)
    file = TruthFile.read(folder / "truth.json", largest=LARGEST_FILE, hint=FORM)
    if problem := next(contradictions(file), None):
        raise BadInput(f"{folder / 'truth.json'}: {problem}", hint=FORM)
    points, owner = read_points(folder / "truth.npz", {entry.id for entry in file.instances})
    return Told(log_in(folder, file), file, points, owner)


def log_in(folder: Path, file: TruthFile) -> Log:
    """Return the one log of a folder: `log`, or `log.` and an ending. Raises BadInput without, or with several."""
    found = sorted(path for path in folder.iterdir() if path.name == "log" or path.name.startswith("log."))
    if len(found) != 1:
        names = ", ".join(path.name for path in found) or "none"
        raise BadInput(f"{folder}: one log is expected, there is {names}", hint="call it log.mcap, log.bag, or log/")
    options = dict(file.ingest)
    every, start = (options.pop(name, default) for name, default in (("every", 1), ("start", 0)))
    if not (isinstance(every, int) and every >= 1 and isinstance(start, int) and start >= 0):
        raise BadInput(f"{folder / 'truth.json'}: ingest: every {every}, start {start}", hint="give whole numbers")
    return Log(folder.resolve().name, found[0], every, start, options)


def contradictions(file: TruthFile) -> Iterator[str]:
    """Yield what a truth says that cannot be, in words."""
    ids = [entry.id for entry in file.instances]
    yield from (f"instance {k} is there twice" for k in sorted({k for k in ids if ids.count(k) > 1}))
    known = set(stage_by_name("ingest").parameters.model_fields)
    yield from (f"ingest: no option {name}" for name in file.ingest if name not in known)
    carried = {entry.id: entry.support for entry in file.instances}
    for entry in file.instances:
        if isinstance(entry.support, int) and entry.support not in carried:
            yield f"instance {entry.id}: its support {entry.support} is no instance"
        above, steps = entry.support, 0
        while isinstance(above, int) and above != entry.id and steps < len(ids):
            above, steps = carried.get(above), steps + 1
        if above == entry.id:
            yield f"instance {entry.id} carries itself, by way of others or not"


def read_points(path: Path, ids: set[int]) -> tuple[np.ndarray, np.ndarray]:
    """Return points (N, 3) [m] and the id (N,) of each. Raises BadInput."""
    try:
        points, owner = read_arrays(path, "points", "instance", shapes=("N 3", "N"), hint=FORM)
    except BadInput as error:
        said = error.message if str(path) in error.message else f"{path}: {error.message}"
        raise BadInput(said, hint=FORM) from None
    if not 0 < len(points) <= MOST_POINTS:
        raise BadInput(f"{path}: {len(points)} points", hint=f"give 1 to {MOST_POINTS}; one a centimetre is enough")
    if owner.dtype.kind not in "iu":
        raise BadInput(f"{path}: instance: {owner.dtype}, expected whole numbers", hint=FORM)
    points, owner = points.astype(float), owner.astype(np.int64)
    if not np.isfinite(points).all() or np.abs(points).max() > LARGEST_LENGTH:
        raise BadInput(f"{path}: points are not finite or over {LARGEST_LENGTH:g} m away", hint="give metres")
    unknown = sorted(set(np.unique(owner).tolist()) - ids - {0})
    if unknown:
        raise BadInput(
            f"{path}: instance {unknown[0]} is not in truth.json ({len(unknown)} such)",
            hint="list it there, or give its points 0",
        )
    return points, owner
