"""`python -m benchmarks.board.checking`: one published trial, drawn by the commit, measured again and compared.

Drawn among the cheapest rung of the public rooms, of the newest version, and measured in a worktree of its commit. If
this checkout judges by other code than the record says, nothing can be compared, and it says so.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from scenewright.schemas.errors import ScenewrightError

from benchmarks.board.__main__ import say, setting_of
from benchmarks.board.method import Method
from benchmarks.board.publishing import read_versions
from benchmarks.board.records import Line, judge_digest
from benchmarks.board.rooms import measure_public

CHEAPEST = "perfect"
DIFFERS = 4


def drawn(lines: Sequence[Line], commit: str) -> Line | None:
    """Return the line that a commit draws; None where there is none."""
    known = [line for line in lines if line.trial.part == "public" and line.trial.case == CHEAPEST]
    return known[int(commit, 16) % len(known)] if known else None


def differing(one: Line, other: Line) -> list[str]:
    """Return the figures that differ, in words."""
    names = sorted({*one.figures, *other.figures})
    pairs = [(name, one.figures.get(name), other.figures.get(name)) for name in names]
    return [f"{name}: {first} in the record, {second} now" for name, first, second in pairs if first != second]


def main(argv: Sequence[str] | None = None) -> int:
    """Measure one line again; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.board.checking", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("outputs/board-check"))
    asked = parser.parse_args(argv)
    try:
        versions = read_versions()
        line = drawn(versions[-1].lines, Method().commit) if versions else None
        if line is None:
            say("no trial is published yet")
            return 0
        if line.judge != judge_digest():
            say(f"{line.trial}: judged by {line.judge}, this checkout judges by {judge_digest()}: nothing to compare")
            return 0
        setting = setting_of(asked.out.resolve(), line.commit, keep=False)
        setting.generator.prepare()
        (again,) = measure_public(setting, line.trial.seed, (CHEAPEST,))
    except ScenewrightError as error:
        say(f"error: {error}")
        return error.exit_code
    found = differing(line, again)
    say(f"{line.trial} of {line.commit}: {'; '.join(found) or f'{len(again.figures)} figures, all equal'}")
    return DIFFERS if found else 0


if __name__ == "__main__":
    sys.exit(main())
