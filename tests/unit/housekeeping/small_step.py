"""A step of our own: writes its text and the digest of what it read, so that chains stay small."""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path

from pydantic import Field
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.kit.stage import Context, External, Optionally, Parameters, Stage


class SmallParameters(Parameters):
    """What it writes."""

    text: str = Field("a", description="content of the file")


SMALL = Stage(
    "small",
    "Step of the housekeeping tests",
    SmallParameters,
    {"upstream": Optionally(Trajectory), "log": Optionally(External("a file"))},
    Trajectory,
)


def run(upstream: Trajectory | None, log: Path | None, *, parameters: SmallParameters, context: Context) -> Trajectory:
    """Write trajectory.tum."""
    read = upstream.path("trajectory.tum") if upstream is not None else log
    digest = hashlib.sha256(read.read_bytes()).hexdigest() if read is not None else ""
    (context.output / "trajectory.tum").write_text(f"# {parameters.text} {digest}\n")
    return Trajectory(context.output)


class _SmallPackage:
    run = staticmethod(run)
    __file__ = __file__


sys.modules.setdefault("scenewright.stages.small.stage", _SmallPackage)  # type: ignore[arg-type]
