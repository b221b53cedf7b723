"""The batch file (TOML): what it may say. docs/BATCH.md has an example with everything."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from scenewright.schemas.errors import UsageError, first_problem
from scenewright.stages.engine.batch.quantities import parse_bytes, parse_seconds, parse_seed_range
from scenewright.stages.kit.configuration import read_toml

HINT = "see docs/BATCH.md"


def _as_text(value: Any) -> str:
    """Values of pipeline variables are texts; a number is written out as Python would."""
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ValueError("give a text or a number")
    text = value if isinstance(value, str) else repr(value)
    if "\0" in text:
        raise ValueError("holds a zero byte")
    return text


def _one_line(text: str) -> str:
    if any(ord(letter) < 32 for letter in text):
        raise ValueError("holds a line break or another control character")
    return text


def _quantity(parse: Callable[[str], float]) -> BeforeValidator:
    def check(value: Any) -> float:
        if not isinstance(value, str):
            raise ValueError(f"{value!r} has no unit; write a text such as '20 min' or '4 GiB'")
        return parse(value)

    return BeforeValidator(check)


def _seeds(value: Any) -> Any:
    return parse_seed_range(value) if isinstance(value, str) else value


Value = Annotated[str, BeforeValidator(_as_text)]
Line = Annotated[str, AfterValidator(_one_line)]
Seconds = Annotated[float, _quantity(parse_seconds)]
Bytes = Annotated[int, _quantity(parse_bytes)]
Seed = Annotated[int, Field(ge=0)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class SceneSpec(_Strict):
    """A scene given by name."""

    name: str
    set: dict[str, Value] = {}


class DataSpec(_Strict):
    """Scenes found on disk; every path becomes the value of one variable. Relative paths start at the batch file."""

    variable: str
    folders: tuple[Line, ...] = Field((), strict=False)
    glob: Line | None = None
    list: Line | None = None
    """A text file with one path a line; empty lines and lines that begin with # are left out."""


class ParameterSet(_Strict):
    """Named values: one condition of the experiment."""

    name: str
    set: dict[str, Value] = {}


class Limits(_Strict):
    """What one scene may take, and when to give up on the batch."""

    time: Seconds | None = None
    """Wall clock [s]; `20 min` in the file."""
    memory: Bytes | None = None
    """Resident memory of all processes of a scene together [bytes]; `4 GiB` in the file."""
    address_space: Bytes | None = None
    """RLIMIT_AS of every process of a scene [bytes]. Native libraries reserve far more than they use."""
    grace: Seconds = 10.0
    """Between the request to stop and the kill [s]."""
    stop_after_failures: Annotated[int, Field(ge=1)] | None = None


class StorageSpec(_Strict):
    """Where the artifacts of scenes go when they are made (storage.py)."""

    url: Line
    """Of a folder: `s3://bucket/rooms`, `file:///mnt/rooms`, or another that fsspec knows."""
    keep: bool = True
    """Whether a scene that ended well keeps its artifacts in its run folder too."""
    timeout: Seconds = 60.0
    """For one file, or one question [s]."""


class LocalOptions(_Strict):
    """Processes on this machine."""

    kind: Literal["local"] = "local"
    jobs: Annotated[int, Field(ge=1)] = 1
    threads: Annotated[int, Field(ge=1)] | None = None
    """Threads of numeric libraries per scene; by default the processors divided by `jobs`."""
    warm: bool = False
    """Whether scenes run in forks of workers that keep in memory what scenes before had to load (warm.py)."""


class RayOptions(_Strict):
    """A Ray cluster. Inputs and outputs lie on storage that every node mounts at the same path."""

    kind: Literal["ray"]
    address: str = "auto"
    """`auto` for the cluster this machine belongs to, `HOST:PORT`, or `local` to start one here."""
    jobs: Annotated[int, Field(ge=1)] | None = None
    """Scenes at once at most; by default what the cluster's resources allow."""
    cpus: Annotated[float, Field(gt=0)] = 1.0
    memory: Bytes | None = None
    """Memory that Ray reserves for a scene [bytes]; [limits] memory by default."""
    resources: dict[str, Annotated[float, Field(gt=0, strict=False)]] = {}
    """Custom resources of the cluster's nodes that a scene takes."""
    retries: Annotated[int, Field(ge=0)] = 2
    """How often a scene is given to another worker after its worker was lost."""
    warm: bool = False
    """Whether scenes run in forks of workers that keep in memory what scenes before had to load (warm.py)."""


class SlurmOptions(_Strict):
    """Scripts for a Slurm job array."""

    kind: Literal["slurm"]
    jobs: Annotated[int, Field(ge=1)] | None = None
    """Array tasks at once (the % of --array)."""
    scenes_per_task: Annotated[int, Field(ge=1)] = 1
    """Short runs are grouped, so that Slurm's own overhead is paid once for several."""
    largest_array: Annotated[int, Field(ge=1)] = 1000
    """MaxArraySize of the cluster; more scenes than this are grouped further."""
    cpus: Annotated[int, Field(ge=1)] = 1
    directives: tuple[Line, ...] = Field((), strict=False)
    """Further words for #SBATCH lines, such as `--partition=short`."""
    setup: tuple[Line, ...] = Field((), strict=False)
    """Shell lines before the work, such as `module load python`. They run as they are."""


class BatchSpec(_Strict):
    """A batch file."""

    pipeline: Line
    set: dict[str, Value] = {}
    accept: tuple[Line, ...] = Field((), strict=False)
    """Outcomes of steps besides ok after which a scene has ended well, as `run --accept` takes them."""
    scene: tuple[SceneSpec, ...] = Field((), strict=False)
    data: DataSpec | None = None
    parameters: tuple[ParameterSet, ...] = Field((), strict=False)
    seeds: Annotated[tuple[Seed, ...], Field(strict=False), BeforeValidator(_seeds)] = ()
    seed_variable: str = "seed"
    shuffle_seed: int = 0
    limits: Limits = Limits()
    storage: StorageSpec | None = None
    executor: Annotated[LocalOptions | RayOptions | SlurmOptions, Field(discriminator="kind")] = LocalOptions()


def read_spec(path: Path) -> BatchSpec:
    """Read a batch file. Raises UsageError naming the file and the first wrong field."""
    values = read_toml(path, hint="a batch is a TOML file, see docs/BATCH.md")
    return check_spec(values, str(path))


def check_spec(values: dict[str, Any], path: str) -> BatchSpec:
    """Check the values of a batch file. Raises UsageError naming `path` and the first wrong field."""
    try:
        return BatchSpec.model_validate(values)
    except ValidationError as error:
        raise UsageError(f"{path}: {first_problem(error)}", hint=HINT) from None
