"""A step of our own for the contract tests: writes a few files slowly, in a way the test chooses."""

from __future__ import annotations

import sys
import time
from importlib import import_module
from pathlib import Path

from pydantic import Field
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.kit.stage import Context, External, Optionally, Parameters, Stage


class ProbeParameters(Parameters):
    """What the probe writes."""

    text: str = Field("a", description="content of every file")
    files: int = Field(8, ge=1, description="number of files")
    pause: float = Field(0.0, ge=0, description="pause after each file [s]")
    behaviour: str = Field(
        "write",
        description="write, raise, empty, random, fill memory, import nonsense, swallow interrupts "
        "or turn interrupts into errors",
    )


PROBE = Stage(
    "probe",
    "Probe of the contract tests",
    ProbeParameters,
    {"upstream": Optionally(Trajectory), "log": Optionally(External("a file"))},
    Trajectory,
)


def run(upstream: Trajectory | None, log: Path | None, *, parameters: ProbeParameters, context: Context) -> Trajectory:
    """Write the files; what it read decides them too."""
    text = parameters.text
    if upstream is not None:
        text += upstream.path("file-0.txt").read_text()
    if parameters.behaviour == "random":
        text += str(time.perf_counter_ns())
    if parameters.behaviour == "fill memory":
        text = " " * (1 << 40)
    if parameters.behaviour == "import nonsense":
        import_module("nonsense")
    (context.output / "trajectory.tum").write_text("")
    for number in range(parameters.files):
        (context.output / f"file-{number}.txt").write_text(text * 1000)
        try:
            time.sleep(parameters.pause)
        except KeyboardInterrupt:
            if parameters.behaviour == "turn interrupts into errors":
                raise SystemError("returned a result with an exception set") from None
            if parameters.behaviour != "swallow interrupts":
                raise
        if parameters.behaviour == "raise" and number == 1:
            raise RuntimeError("the probe was told to fail")
    if parameters.behaviour == "empty":
        return Trajectory(context.output, outcome="empty", summary={"reason": "the probe was told to find nothing"})
    return Trajectory(context.output, summary={"files": parameters.files})


class _ProbePackage:
    run = staticmethod(run)
    __file__ = __file__


sys.modules.setdefault("scenewright.stages.probe.stage", _ProbePackage)  # type: ignore[arg-type]
