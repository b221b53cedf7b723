"""One line a trial: what was measured, of what, by which code. Everything that is printed comes out of these lines."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

from pydantic import ValidationError
from scenewright.schemas.base import Model, canonical_json
from scenewright.schemas.errors import BadInput
from scenewright.stages.engine.code.digests import code_of

from benchmarks.board.inputs import BOARD, GENERATOR, SCRIPTS

RECORDS = Path(__file__).resolve().parents[2] / "docs" / "results" / "board"
JUDGES = (
    "benchmarks.board.judge:judge",
    "benchmarks.board.reconstruct:reconstruct",
    "benchmarks.board.inputs:Generator",
)
"""What of this checkout decides what a trial of a generated room comes to."""


class Trial(Model):
    """One arm in one room, or on one log, under one condition."""

    part: str
    case: str
    """The rung; what of a log; the system."""
    seed: str
    """The room, the log, or the number that is drawn with."""
    arm: str

    def __str__(self) -> str:
        return f"{self.part}: {self.case}, {self.seed}, {self.arm}"


class Line(Model):
    """A trial and what came of it."""

    trial: Trial
    key: str
    commit: str
    """Of the method."""
    committed: str
    """When that commit was made: versions are told in this order."""
    digest: str
    """Of the method."""
    clean: bool
    """Whether both checkouts were as committed."""
    board: str
    """Commit of the checkout that judged."""
    judge: str
    """Sixteen digits of the code that judged: figures of two judges do not compare."""
    day: str
    """When it was measured."""
    figures: dict[str, float] = {}
    facts: dict[str, str] = {}
    """In words: why a step ended without an artifact, which task it was."""
    seconds: dict[str, float] = {}
    """Processor seconds of each step."""


@cache
def judge_digest(judges: tuple[str, ...] = JUDGES) -> str:
    """Return sixteen digits of the code that judges, as it was when this process began."""
    return code_of(*judges, also=("benchmarks",)).digest[:16]


def key_of(trial: Trial, method: str, arm: object, judge: str) -> str:
    """Return what a trial is kept under: sixteen digits over the trial, its inputs, the method, the arm, the judge."""
    scripts = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(SCRIPTS.glob("*.py"))}
    facts = {
        "trial": trial.model_dump(),
        "inputs": {"board": BOARD, "generator": GENERATOR, "scripts": scripts},
        "method": method,
        "arm": arm,
        "judge": judge,
    }
    return hashlib.sha256(canonical_json(facts).encode()).hexdigest()[:16]


def line_text(line: Line) -> str:
    """Return a line as it stands in a file of records."""
    return canonical_json(line.model_dump(mode="json")) + "\n"


def read_lines(file: Path) -> list[Line]:
    """Return the lines of a file; none where it is missing. Raises BadInput for a line that no program writes."""
    if not file.is_file():
        return []
    lines = []
    for number, text in enumerate(file.read_text(encoding="utf-8").splitlines(), start=1):
        try:
            line = Line.model_validate_json(text)
        except ValidationError as error:
            raise BadInput(f"{file}:{number}: {error.errors()[0]['msg']}", hint="records are measured") from None
        if line_text(line) != f"{text}\n":
            raise BadInput(f"{file}:{number}: not as a program writes it", hint="records are measured")
        lines.append(line)
    return lines


def write_lines(file: Path, lines: Iterable[Line]) -> None:
    """Write a file of records whole, sorted by trial."""
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_name(f"{file.name}.partial")
    ordered = sorted(lines, key=lambda line: tuple(line.trial.model_dump().values()))
    partial.write_text("".join(map(line_text, ordered)), encoding="utf-8")
    partial.replace(file)


def by_case(lines: Iterable[Line]) -> Mapping[tuple[str, str, str], list[Line]]:
    """Return the lines by part, case and arm, in the order of the rooms."""
    groups: dict[tuple[str, str, str], list[Line]] = {}
    for line in lines:
        groups.setdefault((line.trial.part, line.trial.case, line.trial.arm), []).append(line)
    return groups
