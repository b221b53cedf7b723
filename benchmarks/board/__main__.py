"""`make board`: measure shards of the board, one after another, and keep a line for each trial."""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from scenewright.schemas.errors import ScenewrightError, UsageError

from benchmarks.board.inputs import Generator
from benchmarks.board.looks import note_look
from benchmarks.board.method import REPOSITORY, Method, checkout_of
from benchmarks.board.quick import quick_table, quick_units
from benchmarks.board.real.figures import line
from benchmarks.board.real.told import measure_truth
from benchmarks.board.records import RECORDS, write_lines
from benchmarks.board.rooms import REFERENCE_COMMIT, Setting
from benchmarks.board.shards import JOBS, all_shards, measure_shard

UNFINISHED = 4
"""Exit code when a unit failed: what is measured is kept, and nothing is recorded of its shard."""


def main(argv: Sequence[str] | None = None) -> int:
    """Measure the shards that are asked for; return the exit code (docs/ARCHITECTURE.md)."""
    asked = parser().parse_args(argv)
    try:
        return run(asked)
    except KeyboardInterrupt:
        say("stopped; what is measured is kept")
        return 130
    except ScenewrightError as error:
        say(f"error: {error}")
        return error.exit_code


def parser() -> argparse.ArgumentParser:
    """Return the parser."""
    made = argparse.ArgumentParser(prog="python -m benchmarks.board", description=__doc__)
    made.add_argument("--out", type=Path, default=Path("outputs/board"), help="rooms, artifacts, kept lines")
    made.add_argument("--method", default="", help="commit that is measured; default: this checkout")
    made.add_argument("--shards", nargs="+", default=[], metavar="SHARD", help=f"only these: {', '.join(all_shards())}")
    made.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder with the recorded logs")
    made.add_argument("--truth", type=Path, help="a log with a truth of one's own (docs/DATA.md), and nothing else")
    made.add_argument("--quick", action="store_true", help="five minutes: what they allow of every part, not recorded")
    made.add_argument("--jobs", type=int, default=JOBS, help="units at a time")
    made.add_argument("--keep", action="store_true", help="leave the artifacts (100 MB a room)")
    made.add_argument("--commit", action="store_true", help="commit the records of each shard")
    return made


def run(asked: argparse.Namespace) -> int:
    """Measure shard after shard. Raises ScenewrightError."""
    out = asked.out.resolve()
    if asked.truth is not None:  # needs neither generator nor reference, so no history of git
        method = Method(checkout_of(asked.method, out / "checkouts")) if asked.method else Method()
        print(line(measure_truth(method, asked.truth.resolve(), out / "work" / "truth")))
        return 0
    setting = setting_of(out, asked.method, keep=asked.keep, data=asked.data.resolve())
    if asked.quick:
        return quick(setting, asked.jobs)
    shards = all_shards()
    for name in asked.shards:
        if name not in shards:
            raise UsageError(f"no shard {name!r}", hint=f"there are {', '.join(shards)}")
    clean = setting.method.clean and setting.board.clean  # before anything runs: what is edited meanwhile is not it
    say(f"method {setting.method.commit}, digest {setting.method.digest}{'' if clean else ', uncommitted changes'}")
    setting.generator.prepare()
    code = 0
    for name in asked.shards or shards:
        units, start = shards[name], time.monotonic()
        written = [note_look(setting.method.digest, setting.method.commit)] if name.startswith("sealed") else []
        lines, problems = measure_shard(setting, units, partial(say_of, name), asked.jobs)
        say(f"{name}: {len(lines)} lines, {(time.monotonic() - start) / 60:.1f} min")
        if problems or not clean:
            code = UNFINISHED if problems else code
            why = "; ".join(problems) if problems else "a checkout holds uncommitted changes"
            say(f"{name}: not recorded: {why}")
            continue
        file = RECORDS / "records" / setting.method.commit / f"{name}.jsonl"
        write_lines(file, lines)
        if asked.commit:
            commit([*written, file], f"Board: {name} of {setting.method.commit}")
    return code


def quick(setting: Setting, jobs: int) -> int:
    """Measure what five minutes allow, and print a row for everything that the board has."""
    setting.generator.prepare()
    lines, problems = measure_shard(setting, quick_units(), lambda text: say(f"quick: {text}"), jobs)
    print(quick_table(lines))
    for problem in problems:
        say(problem)
    return UNFINISHED if problems else 0


def setting_of(out: Path, method: str, *, keep: bool, data: Path = Path()) -> Setting:
    """Return what is measured, against what, and where everything lies."""
    checkouts = out / "checkouts"
    return Setting(
        method=Method(checkout_of(method, checkouts)) if method else Method(),
        reference=Method(checkout_of(REFERENCE_COMMIT, checkouts)),
        generator=Generator(out),
        work=out / "work",
        kept=out / "kept",
        board=Method(),
        data=data,
        keep=keep,
    )


def commit(files: Sequence[Path], message: str) -> None:
    """Commit files of records, and nothing else that is staged."""
    words = ["git", "-C", str(REPOSITORY)]
    subprocess.run([*words, "add", "--", *map(str, files)], check=True)
    subprocess.run([*words, "commit", "--quiet", "--message", message, "--", *map(str, files)], check=True)


def say_of(shard: str, text: str) -> None:
    """Print a line of progress of a shard."""
    say(f"{shard}: {text}")


def say(text: str) -> None:
    """Print a line of progress."""
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    raise SystemExit(main())
