"""`python -m benchmarks.board.checking`: one published trial, drawn by the commit, measured again and compared.

Drawn among the cheapest rung of the public rooms, of the newest version, and measured in a worktree of its commit, by
its judge: where the code that judges has changed since, in a worktree of the commit that judged it.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from scenewright.schemas.errors import MachineFailure, ScenewrightError, UsageError

from benchmarks.board.__main__ import say
from benchmarks.board.method import REPOSITORY, Method, checkout_of
from benchmarks.board.publishing import read_versions
from benchmarks.board.records import Line, judge_digest, read_lines

CHEAPEST = "perfect"
DIFFERS = 4
ONE_TRIAL = """
import sys
from pathlib import Path
from benchmarks.board.__main__ import setting_of
from benchmarks.board.records import line_text
from benchmarks.board.rooms import measure_public
setting = setting_of(Path(sys.argv[1]), sys.argv[2], keep=False)
setting.generator.prepare()
(line,) = measure_public(setting, sys.argv[3], (sys.argv[4],))
Path(sys.argv[5]).write_text(line_text(line), encoding="utf-8")
"""
"""What a judge is asked: folder, method, seed, rung, and the file to write. `make board` has the same doors."""


def drawn(lines: Sequence[Line], commit: str) -> Line | None:
    """Return the line that a commit draws; None where there is none."""
    known = [line for line in lines if line.trial.part == "public" and line.trial.case == CHEAPEST]
    return known[int(commit, 16) % len(known)] if known else None


def commits_since(commit: str) -> int:
    """Return how many commits changed what is measured since one. Raises UsageError for one of no history."""
    words = ["git", "-C", str(REPOSITORY), "rev-list", "--count", f"{commit}..HEAD"]
    done = subprocess.run([*words, "--", "stages", "schemas", "data"], capture_output=True, text=True, check=False)
    if done.returncode:
        raise UsageError(f"no commit {commit} here", hint="clone the project with its history: git fetch --unshallow")
    return int(done.stdout)


def differing(one: Line, other: Line) -> list[str]:
    """Return the figures that differ, in words."""
    names = sorted({*one.figures, *other.figures})
    pairs = [(name, one.figures.get(name), other.figures.get(name)) for name in names]
    return [f"{name}: {first} in the record, {second} now" for name, first, second in pairs if first != second]


def measured_again(line: Line, out: Path) -> Line:
    """Measure a public trial again below `out`, by the code that judged it. Raises ScenewrightError."""
    judge = REPOSITORY if line.judge == judge_digest() else checkout_of(line.board, out / "checkouts")
    written = out / "again.jsonl"
    written.parent.mkdir(parents=True, exist_ok=True)
    written.unlink(missing_ok=True)
    words = [str(out), line.commit, line.trial.seed, CHEAPEST, str(written)]
    environment = {**os.environ, "PYTHONPATH": str(judge)}
    done = subprocess.run([sys.executable, "-P", "-c", ONE_TRIAL, *words], env=environment, cwd=judge, check=False)
    if done.returncode:
        raise MachineFailure(f"{line.trial}: measuring it again ended with {done.returncode}", hint="see above")
    return read_lines(written)[0]


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
        say(f"{commits_since(line.commit)} commits changed the method since {line.commit}, whose figures are published")
        again = measured_again(line, asked.out.resolve())
        if again.judge != line.judge:
            say(f"{line.trial}: judged by {line.judge}, {line.board} judges by {again.judge}: nothing to compare")
            return 0
    except UsageError as error:  # a clone without history cannot be asked
        say(f"nothing compared: {error}")
        return 0
    except ScenewrightError as error:
        say(f"error: {error}")
        return error.exit_code
    found = differing(line, again)
    say(f"{line.trial} of {line.commit}: {'; '.join(found) or f'{len(again.figures)} figures, all equal'}")
    return DIFFERS if found else 0


if __name__ == "__main__":
    sys.exit(main())
