"""Real logs through the chain, judged: annotated ones, halves of them, or a log with a truth of one's own.

Writes records.jsonl, one line a log and kind, and prints what a lab wants to know of each. The artifacts stay in
OUT/<log>, where other experiments take them from.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from pydantic import Field
from scenewright.schemas.errors import ScenewrightError

from benchmarks.board.method import REPOSITORY, Method
from benchmarks.board.real.annotated import measure_annotated
from benchmarks.board.real.chain import masks_of
from benchmarks.board.real.figures import line
from benchmarks.board.real.halves import measure_halves
from benchmarks.board.real.logs import LOGS
from benchmarks.board.real.records import AnnotatedRecord, HalvesRecord, TruthRecord
from benchmarks.board.real.told import measure_truth
from benchmarks.options import Recipe, asked

Record = AnnotatedRecord | HalvesRecord | TruthRecord


class Options(Recipe):
    """Options."""

    data: Path = Field(Path("../shared/data"), description="Folder with the real logs and networks of others")
    logs: tuple[str, ...] = Field(tuple(LOGS), description="Which of the logs")
    halves: bool = Field(False, description="Compare the scenes of even and of odd frames too")
    truth: Path | None = Field(None, description="Folder with a log and its truth (docs/DATA.md); no others then")
    checkout: Path = Field(REPOSITORY, description="The checkout whose commands are measured")


def measured(options: Options) -> Iterator[Record]:
    """Yield the records that are asked for. Raises BadInput or MachineFailure."""
    method = Method(options.checkout)
    if options.truth is not None:
        yield measure_truth(method, options.truth, options.out)
        return
    for name in options.logs[:1] if options.quick else options.logs:
        yield measure_annotated(method, name, options.data, options.out)
        if options.halves:
            yield measure_halves(method, LOGS[name].within(options.data), options.out, masks_of(options.data))


def main() -> int:
    """Measure, write and print; return the exit code."""
    options = asked(Options)
    options.out.mkdir(parents=True, exist_ok=True)
    try:
        with (options.out / "records.jsonl").open("w", encoding="utf-8") as file:
            for record in measured(options):
                row = {"kind": type(record).__name__, **asdict(record)}
                file.write(json.dumps(row, sort_keys=True) + "\n")
                file.flush()
                print(line(record))
    except ScenewrightError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
