"""Records a step's code: `python -m tests.freshness.record STEP... | --all [--same-bytes | --because REASON]`.

After the version was raised nothing more is asked. Under the same version it takes evidence (`--same-bytes`: the step's
small runs by the code as it was recorded and as it is give the same bytes), or a reason in words, which is kept.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from scenewright.stages.engine.discovery import all_stages
from scenewright.stages.kit.stage import Stage

from tests.freshness.program import Program
from tests.freshness.records import REPOSITORY, Record, changed_modules, code_of, read_record
from tests.freshness.same_bytes import Evidence, Refused


def record(stage: Stage, program: Program, evidence: Evidence | None, because: str) -> str:
    """Record one step and say in a line what was done. Raises Refused when that would hide a change."""
    code, before = code_of(program, stage), read_record(stage.name)
    if before is None:
        accepted = f"first record, at version {stage.version}"
    elif stage.version < before.version:
        raise Refused(f"{stage.name}: version {stage.version} is lower than the recorded {before.version}")
    elif stage.version > before.version:
        accepted = f"version {stage.version}"
    elif code.digest == before.code:
        if code.modules == before.modules:
            return f"{stage.name}: nothing changed"
        accepted = before.accepted  # moved or renamed
    elif because:
        accepted = because
    elif evidence is not None:
        accepted = evidence.same_bytes(stage, before)
    else:
        changed = ", ".join(changed_modules(before.modules, code.modules))
        raise Refused(
            f"{stage.name}: version {stage.version} is recorded with other code (changed: {changed}): raise the "
            "version, or give --same-bytes, or --because REASON"
        )
    Record(stage.name, stage.version, code.digest, accepted, code.modules).write()
    return f"{stage.name}: {accepted}"


def main(words: list[str]) -> int:
    """Record the steps named; 1 when one was refused."""
    parser = argparse.ArgumentParser(prog="python -m tests.freshness.record", description=__doc__)
    parser.add_argument("step", nargs="*", help="a step, in one word or several (`fuse`, `tableware simulate`)")
    parser.add_argument("--all", action="store_true", help="every step")
    proof = parser.add_mutually_exclusive_group()
    proof.add_argument("--same-bytes", action="store_true", help="run the steps by old and new code and compare")
    proof.add_argument("--because", default="", metavar="REASON", help="why the bytes are the same; kept in the record")
    parser.add_argument("--since", metavar="COMMIT", help="commit whose code was recorded, where it isn't found")
    given = parser.parse_args(words)
    stages = all_stages()
    name = " ".join(given.step)
    if not given.all and name not in stages:
        parser.error(f"no step {name!r}; steps are: {', '.join(stages)}")
    refused = 0
    program = Program(REPOSITORY)
    with tempfile.TemporaryDirectory(prefix="same-bytes-") as folder:
        evidence = Evidence(Path(folder), given.since) if given.same_bytes else None
        for stage in stages.values() if given.all else [stages[name]]:
            try:
                print(record(stage, program, evidence, given.because), flush=True)
            except Refused as error:
                refused += 1
                print(f"refused: {error}", file=sys.stderr, flush=True)
    return 1 if refused else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
