"""How a step declares itself: options, what it reads, what it writes. Cheap to import; the running is in runner.py."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler, field_validator
from pydantic_core import CoreSchema
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.base import bounded
from scenewright.stages.kit.estimates import Formula

Item = TypeVar("Item")

NOT_SHOWN = "not_shown"
"""Type of a PydanticCustomError whose input must not be printed: a key that was given where its name belongs."""


SMALLEST_ABOVE_ZERO = 1e-9
"""Smallest value of an option that divides, spaces or weighs something."""


class Parameters(BaseModel):
    """Options of a step. The command line, its help, its ranges and the config file come from these fields.

    Every field has a default and a description. Allowed field types: bool, int, float, str, Literal of str,
    Enum, Path-free tuples of str/int/float, and `X | None`. Numbers without bounds of their own have those of payloads,
    and what must be above zero is at least `SMALLEST_ABOVE_ZERO`.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Bound every number."""
        return bounded(handler(source), SMALLEST_ABOVE_ZERO)

    @field_validator("*", mode="after")
    @classmethod
    def _without_minus_zero(cls, value: Any) -> Any:
        """-0.0 passes for at least 0 and is below it to some libraries."""
        return value + 0.0 if isinstance(value, float) else value


@dataclass(frozen=True)
class External:
    """An input that is no artifact: a raw file or folder of the user (a log, a weight file).

    Its digest is the sha256 over its sorted files.
    """

    description: str = "file or folder"
    weights: bool = False
    """A missing weight file is a missing dependency (exit 5) instead of bad input (exit 3)."""


@dataclass(frozen=True)
class Optionally:
    """Marks an input that may be left out; `run` then gets None."""

    what: type[Artifact] | External
    usual: Callable[[Any, Mapping[str, Any]], str] | None = None
    """Parameters and the inputs given (role -> path) -> name of the model that the step takes from the cache of models
    when it is there and nothing else was given; empty: none."""


@dataclass(frozen=True)
class Extra:
    """A distribution that only some options of a step need and that does not come with the project."""

    distribution: str
    module: str
    """What is imported of it."""
    remedy: str
    """What it is for and how to get it, for `doctor`."""


Reads = Mapping[str, type[Artifact] | External | Optionally]


class Progress(Protocol):
    """What a step says about its progress."""

    def track(self, items: Iterable[Item], *, total: int | None = None, description: str = "") -> Iterator[Item]:
        """Yield the items while a bar (terminal) or plain lines (elsewhere) tell how far it is."""
        ...

    def step(self, description: str) -> AbstractContextManager[None]:
        """Name and time one part of the work; the time lands in the artifact's timings."""
        ...


@dataclass(frozen=True)
class Context:
    """What the runner gives a step: where to write, the seed, the device, progress and a logger."""

    output: Path
    """The partial folder; the step writes its payload files here and nowhere else."""
    seed: int
    device: str
    """`cpu` or `cuda`."""
    progress: Progress
    logger: logging.Logger = field(default_factory=lambda: logging.getLogger("scenewright"))
    force: bool = False
    """`--force`: what a step keeps of earlier runs is not to be used."""
    kept: Path | None = None
    """Folder, made by the step when it first needs one, in which a long step may keep its state: a run of the same key
    finds it when this one was killed, and it is gone when the artifact stands. None: nothing can be kept."""

    def random(self, *stream: int) -> np.random.Generator:
        """Return a generator seeded by the run's seed and the given stream numbers."""
        return np.random.default_rng([self.seed, *stream])


@dataclass(frozen=True)
class Stage:
    """One step: `stages/<folder>/parameters.py` holds it as STAGE (or several as STAGES), the function
    `run(**inputs, parameters=..., context=...) -> Artifact` stands in `stages/<folder>/<module>.py`.

    `name` is the command (`fuse`, or `library build` for a command within a group). `libraries` are the distributions
    whose versions decide the bytes of the output. `summary` is one line for the help.
    """

    name: str
    summary: str
    parameters: type[Parameters]
    reads: Reads
    writes: type[Artifact]
    libraries: tuple[str, ...] = ("numpy",)
    module: str = "stage"
    example: str = ""
    argument: str = ""
    """Role that may also be given as the command's one argument (`library add FOLDER`)."""
    data_files: Callable[[Any], tuple[str, ...]] | None = None
    """Parameters -> files of `data/` that the step reads; their content is part of the key. The class vocabulary
    always is."""
    versions: str = ""
    """Module of the step's folder whose function `versions(parameters)` returns name -> version of what decides the
    bytes under these parameters alone: the library of a backend, the model that a service runs. It goes into the key
    and the manifest beside `libraries`; it may raise MissingDependency."""
    extras: tuple[Extra, ...] = ()
    """What some of its options need beyond what comes with the project; `doctor` lists them."""
    check: Callable[[Any, Mapping[str, Any]], None] | None = None
    """Optional check of parameters against the inputs given (role -> path), raising UsageError before work starts."""

    estimate: Formula | None = None
    """Optional: what the step is going to write and to use (`--dry-run`, and before it starts)."""

    @property
    def folder(self) -> str:
        """The folder under stages/ (the first word of the name)."""
        return self.name.split()[0]

    def required(self) -> tuple[str, ...]:
        """Roles that must be given."""
        return tuple(role for role, what in self.reads.items() if not isinstance(what, Optionally))
