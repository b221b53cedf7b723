"""`scenewright urdf check`: what loaders let through and simulators trip over."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from scenewright.cli.output import out

BAD_INPUT = 3
"""Exit code of a broken file (docs/ARCHITECTURE.md, "Exit codes")."""


def urdf_check(
    file: Annotated[Path, typer.Argument(help="URDF file.")],
    root: Annotated[
        Path | None, typer.Option("--root", help="Folder that its meshes must lie in. [default: that of the file]")
    ] = None,
    penetration: Annotated[
        float, typer.Option("--penetration", min=0.0, help="Links may lie in each other by this much at rest [m].")
    ] = 0.005,
    json_output: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> int:
    """Say what is wrong with a URDF, a line for each finding: meshes that are missing or outside, circles, dangling
    links, NaN, axes, limits, masses, inertias, and links that lie in each other at rest. Exits with 3 when anything is.
    What is sound and seldom meant is said as advice.
    """
    from scenewright.stages.kit.formats.urdf_check import Problem, advice, check_urdf

    problems = check_urdf(file, root)
    advised = [] if problems else advice(file)
    if not problems:
        from scenewright.stages.urdf.rest_penetration import resting_penetrations

        problems = [
            Problem("penetration", f"link {p.first!r}", f"lies {1000 * p.depth:.1f} mm in link {p.second!r} at rest")
            for p in resting_penetrations(file, penetration)
        ]
    if json_output:
        document = {"findings": problems, "advice": advised}
        rows = {
            name: [{"kind": p.kind, "element": p.element, "message": p.message} for p in problems_of_kind]
            for name, problems_of_kind in document.items()
        }
        out(json.dumps({"file": str(file), "sound": not problems, **rows}))
    else:
        for problem in problems:
            out(f"{file}: {problem}")
        if not problems:
            out(f"{file}: sound")
        for problem in advised:
            out(f"{file}: advice: {problem}")
    return BAD_INPUT if problems else 0
