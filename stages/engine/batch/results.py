"""What came of every scene: one JSON line each in results.jsonl, appended so that a kill loses at most the last."""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError
from scenewright.schemas.base import Count, Model, Seed, canonical_json
from scenewright.schemas.errors import BadInput, MachineFailure, first_problem
from scenewright.schemas.outside import file_content
from scenewright.stages.engine.batch.outcomes import Outcome

RESULTS_NAME = "results.jsonl"
LARGEST_RESULTS = 2**30
"""Largest file of results [bytes]: a million scenes."""
FORMAT = 1
"""Version of the lines of results.jsonl."""


class SceneResult(Model):
    """One finished scene."""

    format: int = FORMAT
    job: str
    scene: str
    parameters: str | None = None
    seed: Seed | None = None
    fingerprint: str
    outcome: Outcome
    exit_code: int
    """0 to 255; 128 + n for a scene that died of signal n."""
    failed_step: str | None = None
    reason: str = ""
    """One line; empty when all went well."""
    seconds: float = Field(ge=0)
    """Wall clock [s] of the attempt that counts."""
    peak_memory_bytes: Count = 0
    """The most resident memory seen over all processes together, or of the largest one, whichever is more."""
    processor_seconds: float = Field(default=0.0, ge=0)
    """Of all processes of the attempt that counts, in all their threads [s]; of those that were killed, none."""
    artifact_bytes: Count = 0
    """Of the artifacts that `artifacts` names."""
    host: str = ""
    started: str = ""
    """UTC, ISO 8601."""
    attempts: int = Field(1, ge=1)
    lost: tuple[str, ...] = ()
    """Why earlier attempts did not count: one text for each worker that went away."""
    artifacts: dict[str, str] = {}
    """Step -> content digest, of the steps that ended well (and of the one whose outcome was not ok)."""
    outcomes: dict[str, str] = {}
    """Step -> outcome, where it is not `ok`."""
    measures: dict[str, float] = {}
    """`<step>/<measure>` -> figure, from evaluation artifacts; without one, from the summaries of the steps."""

    def as_line(self) -> bytes:
        """Return the result as one line of JSON."""
        return (canonical_json(self.model_dump(mode="json")) + "\n").encode()


def parse_line(line: bytes, where: str) -> SceneResult:
    """Read one line. Raises BadInput for one that is no result, or a newer one."""
    try:
        return SceneResult.model_validate_json(line)
    except ValidationError as error:
        hint = "remove that line; its scene then runs again"
        raise BadInput(f"{where}: {first_problem(error, 'line')}", hint=hint) from None


def read_results(path: Path) -> list[SceneResult]:
    """Return all whole lines of a results file; none when there is no file.

    A last line without its end is what a kill tore: it is left out, and `ResultsFile` cuts it off. Raises BadInput for
    a damaged line elsewhere.
    """
    if not os.path.lexists(path):
        return []
    content = file_content(path, LARGEST_RESULTS, hint="check the folder")
    lines = content.split(b"\n")[:-1]
    return [parse_line(line, f"{path}, line {number}") for number, line in enumerate(lines, start=1) if line.strip()]


def latest_by_job(results: Iterable[SceneResult]) -> dict[str, SceneResult]:
    """Return the last result of each job."""
    return {result.job: result for result in results}


class ResultsFile:
    """Appends results. The caller holds the lock of the batch folder."""

    def __init__(self, path: Path) -> None:
        """Open for appending; a torn last line is cut off. Raises MachineFailure."""
        self.path = path
        try:
            self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
            self.repaired = self._cut_torn_line()
        except OSError as error:
            raise MachineFailure(f"{path}: {error.strerror}", hint="choose another --out") from None

    def _cut_torn_line(self) -> int:
        """Return how many bytes of a torn line were cut off."""
        size = os.fstat(self._descriptor).st_size
        end = size
        while end > 0:
            begin = max(0, end - 2**16)
            block = os.pread(self._descriptor, end - begin, begin)
            newline = block.rfind(b"\n")
            if newline >= 0:
                end = begin + newline + 1
                break
            end = begin
        if end < size:
            os.ftruncate(self._descriptor, end)
            os.fsync(self._descriptor)
        return size - end

    def append(self, result: SceneResult) -> None:
        """Add one line and flush it to the disk. Raises MachineFailure; the file then ends where it did before."""
        line = result.as_line()
        size = os.fstat(self._descriptor).st_size
        try:
            written = os.write(self._descriptor, line)
            if written < len(line):
                raise OSError(28, "no space left")
            os.fsync(self._descriptor)
        except OSError as error:
            with suppress(OSError):  # otherwise the next opening cuts the torn line off
                os.ftruncate(self._descriptor, size)
            raise MachineFailure(f"{self.path}: {error.strerror}", hint="free space, then run again") from None

    def close(self) -> None:
        """Close the file."""
        os.close(self._descriptor)

    def __enter__(self) -> ResultsFile:
        return self

    def __exit__(self, *details: Any) -> None:
        self.close()
