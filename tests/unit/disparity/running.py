"""Runs the step without the command line."""

from __future__ import annotations

from pathlib import Path

from schemas.disparity import Disparity
from schemas.sequence import Sequence
from stages.disparity.parameters import DisparityParameters
from stages.disparity.stage import run
from stages.kit.progress import SilentProgress
from stages.kit.stage import Context


def matched(sequence: Sequence, output: Path, **options: object) -> Disparity:
    """Match a sequence's pairs into a new folder."""
    output.mkdir(parents=True)
    context = Context(output=output, seed=0, device="cpu", progress=SilentProgress())
    return run(sequence, None, parameters=DisparityParameters(**options), context=context)  # type: ignore[arg-type]
