"""The log of the needle benchmark: one estimate a line."""

from __future__ import annotations

from pathlib import Path

from benchmarks.run_log import read_log
from stages.suture.evaluation.judgement import Estimate


def read_estimates(path: Path) -> list[Estimate]:
    """Return the estimates of a log; a line that was cut off at the end is taken out of the file."""
    return read_log(path, Estimate)
