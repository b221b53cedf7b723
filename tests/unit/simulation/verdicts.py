"""What physics says of a few scenes, to the bit: `python -m tests.unit.simulation.verdicts FOLDER [execute] [fork]`
writes FOLDER/verdicts.json, from a fork of itself where asked."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context
from scenewright.stages.plan.parameters import PlanParameters
from scenewright.stages.urdf.settle_report import settle_report
from scipy.spatial.transform import Rotation

from tests.unit.simulation.handmade_scene import HandmadeBody, bottle, floor, kitchen, table, write_scene

Verdicts = dict[str, tuple[str, str]]
"""Scene -> verdict, digest of every number behind it."""


def _tilted(body: HandmadeBody, degrees: float, height: float) -> HandmadeBody:
    """A body that drops onto an edge and rocks."""
    pose = body.world_from_body.copy()
    pose[:3, :3] = Rotation.from_euler("xyz", (degrees, 0.6 * degrees, 20.0), degrees=True).as_matrix()
    pose[2, 3] += height
    return replace(body, world_from_body=pose)


def rocking() -> list[HandmadeBody]:
    """Two bottles that rock on a table, one of them over its edge."""
    first = _tilted(bottle(0.0, 0.0, 0.75, "table_3", "supports", "bottle_4"), 4.0, 0.004)
    second = _tilted(bottle(0.575, 0.1, 0.75, "table_3", "supports", "bottle_5"), 2.0, 0.003)
    return [floor(), table(0.0, 0.0), first, second]


def verdicts(folder: Path, *, execute: bool) -> Verdicts:
    """Settle, sweep and (`execute`) carry out a plan in scenes written below a folder."""
    found: Verdicts = {}
    for name, bodies in {"kitchen": kitchen(0.0), "rocking": rocking()}.items():
        write_scene(folder / name, bodies)
        report = settle_report(folder / name, 1.0)
        poses = b"".join(np.stack(body.poses).tobytes() for body in report.bodies)
        numbers = hashlib.sha256(repr(report.as_json()).encode() + poses)
        found[name] = (report.verdict, numbers.hexdigest())
    if execute:
        found["execution"] = _executed(folder)
    return found


def _executed(folder: Path) -> tuple[str, str]:
    from scenewright.stages.plan.stage import run

    output = folder / "plan"
    output.mkdir()
    context = Context(output=output, seed=0, device="cpu", progress=SilentProgress())
    parameters = PlanParameters(goal=("holding(cup_5)",), relocalize=False, image_width=64, video_rate=0)
    plan = run(InteractiveScene(folder / "kitchen"), None, None, parameters=parameters, context=context)
    with np.load(plan.path("trajectory.npz"), allow_pickle=False) as arrays:
        moved = b"".join(arrays[name].tobytes() for name in sorted(arrays))
    text = plan.path("plan.json").read_bytes()
    return plan.info.status, hashlib.sha256(text + moved).hexdigest()


def _write(folder: Path, *, execute: bool) -> None:
    folder.mkdir(parents=True)
    (folder / "verdicts.json").write_text(json.dumps(verdicts(folder, execute=execute)))


if __name__ == "__main__":
    if "fork" in sys.argv[2:]:
        child = os.fork()
        if child:
            sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
    _write(Path(sys.argv[1]), execute="execute" in sys.argv[2:])
