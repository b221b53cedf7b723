"""What is remembered of a step: its version, the digest of its code, and why the two go together."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path

from scenewright.stages.kit.stage import Stage

from tests.freshness.program import Code, Definition, Program

FOLDER = Path(__file__).resolve().parent / "steps"
REPOSITORY = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Record:
    """`steps/<step>.json`."""

    step: str
    version: int
    code: str
    """Of program.py; the names of modules have no part in it."""
    accepted: str
    """Why this code belongs to this version."""
    modules: dict[str, str]
    """What is reached of each module, to name those that changed."""

    def write(self) -> None:
        """Write it to its place."""
        FOLDER.mkdir(exist_ok=True)
        path_of(self.step).write_text(json.dumps(asdict(self), indent=1) + "\n")


def path_of(step: str) -> Path:
    """The file of a step."""
    return FOLDER / f"{step.replace(' ', '_')}.json"


def read_record(step: str) -> Record | None:
    """Return what is remembered of a step, or None."""
    path = path_of(step)
    return Record(**json.loads(path.read_text())) if path.is_file() else None


def code_of(program: Program, stage: Stage) -> Code:
    """Return the code of a step: what `run` and the class of its parameters reach. Raises KeyError without them."""
    declared = stage.parameters
    run = Definition(f"scenewright.stages.{stage.folder}.{stage.module}", "run")
    return program.code_of([run, Definition(declared.__module__, declared.__name__)])


def changed_modules(before: dict[str, str], now: dict[str, str]) -> list[str]:
    """Return the modules whose code differs or is gone; one that only moved is none of them."""
    new, gone = Counter(now.values()) - Counter(before.values()), Counter(before.values()) - Counter(now.values())
    differing = {name for name, digest in now.items() if digest in new}
    missing = {name for name, digest in before.items() if digest in gone}
    return sorted(differing | missing)


def complaint(stage: Stage, record: Record | None, code: Code) -> str | None:
    """What is wrong with a step's record, and which command sets it right; None when it is true."""
    command = f"python -m tests.freshness.record {stage.name}"
    if record is None:
        return f"{stage.name}: nobody has recorded its code: {command}"
    if stage.version < record.version:
        return f"{stage.name}: version {stage.version} is lower than the recorded {record.version}"
    if stage.version > record.version:
        return f"{stage.name}: version {stage.version} is not recorded yet: {command}"
    if code.digest == record.code:
        return None
    return (
        f"{stage.name}: its code changed, its version ({stage.version}) did not. Changed, of what it reaches: "
        f"{', '.join(changed_modules(record.modules, code.modules)) or 'the order in which things are used'}.\n"
        f"Does its output mean something else now? Raise `version` in its declaration (stages/{stage.folder}), then "
        f"`{command}`.\nAre the bytes the same? `{command} --same-bytes` runs it as it was and as it is."
    )
