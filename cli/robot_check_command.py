"""`scenewright robot check`: what a robot's description comes to before anything is planned with it."""

from __future__ import annotations

import json
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from scenewright.cli.output import out

if TYPE_CHECKING:
    from scenewright.stages.plan.robot_check import RobotReport

BAD_INPUT = 3
"""Exit code of a robot with problems (docs/ARCHITECTURE.md, "Exit codes")."""
PICTURE = "robot.png"


def check(
    file: Annotated[str, typer.Argument(help="A description (.toml), or the name of a robot of data/robots.")],
    folder: Annotated[Path | None, typer.Option("--out", help=f"Folder for the picture {PICTURE}.")] = None,
    json_output: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> int:
    """Say what a robot's description comes to: joint limits, collisions with itself, where it reaches with the hand
    down, the gripper's frame, and a line for each problem. Exits with 3 when there is any.
    """
    from scenewright.schemas.errors import MachineFailure
    from scenewright.stages.kit.simulation.robot_description import load_robot
    from scenewright.stages.plan.robot_check import check_robot, urdf_faults

    robot = load_robot(file)
    if faults := urdf_faults(robot):
        if json_output:
            out(json.dumps({"file": file, "sound": False, "robot": robot.name, "problems": faults}))
        else:
            for fault in faults:
                out(f"{robot.name}: problem: {fault}")
        return BAD_INPUT
    if folder is not None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise MachineFailure(f"--out {folder}: {error.strerror or error}", hint="give another folder") from None
    report = check_robot(robot)
    if folder is not None:
        from scenewright.stages.plan.robot_picture import draw_robot_check

        draw_robot_check(folder / PICTURE, robot, report)
    if json_output:
        out(json.dumps({"file": file, "sound": not report.problems, **report.as_json()}))
    else:
        for line in lines(report):
            out(f"{robot.name}: {line}")
    return BAD_INPUT if report.problems else 0


def lines(report: RobotReport) -> list[str]:
    """Return a report as people read it."""
    rows = [f"{len(report.joints)} joints, {'drives' if report.drives else 'stands still'}"]
    rows += [
        f"{joint.name}: {joint.lower:.3f} to {joint.upper:.3f} rad ({degrees(joint.lower):.0f} to "
        f"{degrees(joint.upper):.0f} degrees), {joint.speed:g} rad/s, {joint.force:g} N m"
        for joint in report.joints
    ]
    often = next(iter(report.pairs.items()), None)
    rows.append(f"home (carry): {report.home or 'free of itself'}")
    rows.append(
        f"{100 * report.colliding:.1f} % of drawn arms collide with themselves"
        + (f", most often {often[0]} ({often[1]} times)" if often else "")
    )
    if len(report.reach.places):
        (near, far), (low, high) = report.reach.radii, report.reach.heights
        rows.append(
            f"hand down, the tool reaches {near:.2f} to {far:.2f} m from the first axis, {low:.1f} to {high:.1f} m "
            f"over the floor; at most {report.reach.length:.2f} m from the shoulder"
        )
    gripper = report.gripper
    rows.append(
        f"the gripper opens {1000 * gripper.opening:.0f} mm and closes along {gripper.closes_along} of the tool link, "
        f"whose z is {1000 * gripper.palm_behind:.0f} mm before the hand link"
    )
    rows += [f"note: {note}" for note in report.notes]
    return rows + [f"problem: {problem}" for problem in report.problems] + ([] if report.problems else ["sound"])
