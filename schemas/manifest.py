"""The manifest: the record of how an artifact was made. A folder without a valid one does not exist."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, Field, model_validator
from scenewright.schemas.accepted_code import AcceptedCode
from scenewright.schemas.base import Count, Model
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import check_bounds

MANIFEST_NAME = "manifest.json"
FORMAT_VERSION = 2
"""1: a number of the step, raised by hand, stood in place of the digest of its code."""
LARGEST_MANIFEST = 64 * 2**20
"""A manifest over this size [bytes] is no manifest: 64 MiB list about 300,000 files."""

CONVENTIONS: dict[str, str] = {
    "length": "metre",
    "angle": "radian",
    "time": "second",
    "camera_frame": "OpenCV: x right, y down, z forward",
    "depth": "z-depth",
    "world_frame": "right-handed, z up (REP-103), gravity along -z",
    "transforms": "target_from_source",
    "quaternions": "x, y, z, w",
}


MOST_INPUTS = 1000
"""Most inputs of an artifact; a bound, by eye."""
LONGEST_PATH = 4096
"""Longest path [letters]; no system opens longer ones."""


def _check_path(path: str) -> str:
    if not path or "\0" in path or len(path) > LONGEST_PATH:
        raise ValueError(f"{path!r:.60} is not a path")
    return path


def _check_values(values: dict[str, Any]) -> dict[str, Any]:
    try:
        check_bounds(values, "it holds")
    except BadInput as error:
        raise ValueError(error.message) from None
    return values


AnyPath = Annotated[str, AfterValidator(_check_path)]
Values = Annotated[dict[str, Any], AfterValidator(_check_values)]


class FileRecord(Model):
    """One payload file. `digested` is false for files that hold wall-clock figures."""

    path: AnyPath
    bytes: Count
    sha256: str
    digested: bool = True


class InputRecord(Model):
    """One input: its role, kind, content digest and path relative to the artifact folder."""

    role: str
    kind: str
    digest: str
    path: AnyPath


class Provenance(Model):
    """Who made it, where, and what it cost. Never part of a digest."""

    command: tuple[str, ...] = ()
    package_version: str = ""
    git_commit: str = ""
    git_dirty: bool = False
    lock_digest: str = ""
    platform: str = ""
    python: str = ""
    device: str = "cpu"
    started: str = ""
    seconds: float = 0.0
    peak_memory_bytes: Count = 0


class Manifest(Model):
    """docs/FORMATS.md, manifest."""

    format_version: int = FORMAT_VERSION
    kind: str
    schema_version: int
    stage: str
    code: str = ""
    """Digest of the code of the step that made it (stages/engine/code); empty below format 2."""
    key: str
    content_digest: str
    files: tuple[FileRecord, ...]
    inputs: Annotated[tuple[InputRecord, ...], Field(max_length=MOST_INPUTS)] = ()
    parameters: Values = {}
    seed: Count = 0
    libraries: dict[str, str] = {}
    data_files: dict[str, str] = {}
    """Files of data/ that decided the output -> sha256."""
    device_kind: str = "cpu"
    conventions: dict[str, str] = CONVENTIONS
    accepted_code: Annotated[tuple[AcceptedCode, ...], Field(max_length=MOST_INPUTS)] = ()
    """What `accept-code` let stand, here and in what this was made from."""
    outcome: str = "ok"
    summary: Values = {}
    provenance: Provenance = Provenance()

    @model_validator(mode="before")
    @classmethod
    def _without_step_number(cls, values: Any) -> Any:
        if isinstance(values, dict) and values.get("format_version") == 1:
            return {name: value for name, value in values.items() if name != "stage_version"}
        return values
