"""`scenewright urdf settle`: does a scene stay as it is once it is let go, and can it be opened?"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import typer
from scenewright.cli.output import out

Engine = Literal["bullet", "mujoco"]


def urdf_settle(
    scene: Annotated[Path, typer.Argument(help="Folder of an interactive scene, or `room/` of a ground truth.")],
    seconds: Annotated[float, typer.Option("--seconds", min=0.0, max=60.0, help="Simulated time [s].")] = 3.0,
    moved: Annotated[float, typer.Option("--moved", min=0.0, help="Movable bodies may move by this much [m].")] = 0.01,
    turned: Annotated[
        float, typer.Option("--turned", min=0.0, max=180.0, help="Movable bodies may turn by this much [degrees].")
    ] = 2.0,
    engine: Annotated[Engine, typer.Option("--engine", help="What lets go; pairs and joints are Bullet's.")] = "bullet",
    json_output: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> int:
    """Let go of a scene in physics and open its doors and drawers; a line for each body that moves, turns or falls
    through the floor, for each joint that meets something in the first tenth of its range, and for each pair of bodies
    more than 5 mm in each other. What a tenth of a millimetre may turn reads `marginal`. Exits with 4 when there is
    any that fails, or when nothing can move: the outcome of `urdf`.
    """
    from scenewright.stages.engine.chain import OUTCOME_EXIT_CODE
    from scenewright.stages.kit.simulation.margins import is_marginal
    from scenewright.stages.urdf.settle_margins import with_margins
    from scenewright.stages.urdf.settle_report import SettleReport, settle_report

    limits = {"moved_limit": moved, "turned_limit": math.radians(turned)}
    report: SettleReport = settle_report(scene, seconds if engine == "bullet" else 0.0, **limits)
    report = with_margins(report, scene)
    if engine == "mujoco":
        from scenewright.stages.urdf.mujoco_settle import mujoco_motions

        report = replace(report, seconds=seconds, bodies=mujoco_motions(scene, seconds, **limits))
    lines = [f"{body.name}: falls through the floor" for body in report.unsettled if body.fell_through]
    lines += [
        f"{body.name}: does not stay: moves {1000 * body.moved:.1f} mm, turns {math.degrees(body.turned):.1f} degrees"
        for body in report.unsettled
        if not body.fell_through
    ]
    lines += [
        f"{joint.joint}: meets {joint.hit_link} after {100 * joint.free_share:.0f} % of its range, "
        f"{1000 * joint.hit_depth:.1f} mm deep"
        for joint in report.blocked
    ]
    lines += [
        f"{pair.first_link}: lies {1000 * pair.depth:.1f} mm in {pair.second_link} at rest"
        for pair in report.collisions
    ]
    lines += [
        f"{name}: marginal: {report.margins[name]:.1f} standard deviations to its limit" for name in report.marginal
    ]
    if report.verdict == "nothing_movable":
        lines.append(f"nothing can move: {report.reason}")
    if json_output:
        out(json.dumps({"scene": str(scene), "sound": report.settled, **report.as_json()}))
    else:
        for line in lines:
            out(f"{scene}: {line}")
        if report.settled:
            out(f"{scene}: settles{', marginal' if is_marginal(report.margin) else ''}: {report.reason}")
    return 0 if report.settled else OUTCOME_EXIT_CODE
