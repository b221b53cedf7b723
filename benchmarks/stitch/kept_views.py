"""Options of experiments on views that training keeps too (stages/suture/training/network/views.py)."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.suture.segmentation.checkpoint import BUNDLED

from benchmarks.experiment import Bench


class ViewParameters(Parameters):
    """Options of experiments on kept views."""

    views: Path | None = Field(None, description="Where rendered views are kept; OUT/views if not given")
    checkpoint: Path = Field(BUNDLED, description="Of the network")


def views_of(bench: Bench) -> Path:
    """Return the folder of the kept views."""
    return bench.parameters.views or bench.out / "views"
