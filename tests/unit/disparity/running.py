"""Runs the step without the command line."""

from __future__ import annotations

from pathlib import Path

from scenewright.schemas.disparity import Disparity
from scenewright.schemas.sequence import Sequence
from scenewright.stages.disparity.parameters import DisparityParameters
from scenewright.stages.disparity.stage import run
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context


def matched(sequence: Sequence, output: Path, **options: object) -> Disparity:
    """Match a sequence's pairs into a new folder."""
    output.mkdir(parents=True)
    context = Context(output=output, seed=0, device="cpu", progress=SilentProgress())
    return run(sequence, None, parameters=DisparityParameters(**options), context=context)  # type: ignore[arg-type]
