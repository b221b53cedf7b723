"""Runs ingest without the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from scenewright.schemas.sequence import Sequence
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.stage import run
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context


def ingest(log: Path, output: Path, **options: Any) -> Sequence:
    """Ingest a log into a new folder."""
    output.mkdir(parents=True)
    context = Context(output=output, seed=0, device="cpu", progress=SilentProgress())
    return run(log, parameters=IngestParameters(**options), context=context)
