"""Robots by `--robot`, and what is looked at before and after one is planned with."""

from __future__ import annotations

from pathlib import Path

from tests.advice.rows import Tried

REPLAY = "agent replay --episode {golden}/agent_episode --accept differs --out again "
PHYSICS = "agent run --task place_fruit --simulation physics --turns 1 --accept stopped --image-width 300 --out a "
PACK = "pack --robot ur5 --out p --dry-run "
TEACH = "predicates teach --robot ur5e --out d --dry-run "
FAST = "tableware simulate --scene {golden}/tableware_scene --robot ur5e --out out --dry-run "
DISHES = "tableware simulate --scene {golden}/tableware_scene --simulator physics --accept not_cleared --out out "
EXPORT = "export plan --plan plan --out out "


def given_plan(folder: Path) -> None:
    """A plan for an xArm."""
    from tests.unit.export.test_export_plan import plan_manifest, write_plan

    plan_manifest(write_plan(folder), "xarm7")


def drawn(folder: Path) -> None:
    assert (folder / "here" / "robot.png").stat().st_size > 1000


def with_that_robot(folder: Path) -> None:
    assert '"robot": "xarm7"' in (folder / "out" / "export.json").read_text()


ROWS = [
    Tried(
        "cli/robot_check_command.py",
        "give another folder",
        "robot check ur5e --out /proc/nowhere/here",
        "robot check ur5e --out here",
        code=6,
        right=drawn,
    ),
    Tried(
        "stages/agent/replay_stage.py", "done by the robot", REPLAY + "--robot ur5e", REPLAY + "--robot panda", code=3
    ),
    Tried(
        "stages/agent/world/physics/robot_in_room.py",
        "it does not drive",
        PHYSICS + "--robot ur5_bench",
        PHYSICS + "--robot ur5e",
    ),
    Tried(
        "stages/export/plan_stage.py",
        "planned for --robot",
        EXPORT,
        EXPORT + "--robot xarm7",
        code=3,
        given=given_plan,
        right=with_that_robot,
    ),
    Tried("stages/kit/simulation/robot_option.py", "--robot {}: {}", FAST, FAST + "--simulator physics"),
    Tried("stages/tableware/parameters.py", "give --simulator physics too", FAST, FAST + "--simulator physics"),
    Tried("stages/predicates/parameters.py", "give the rooms", TEACH, TEACH + "--scene {golden}/interactive_scene"),
    Tried("stages/pack/parameters.py", "are the Panda's", PACK + "--limits panda", PACK),
    Tried(
        "stages/tableware/simulation/hand_fit.py",
        "holds of dishes are made for",
        DISHES + "--robot panda",
        DISHES + "--robot ur5",
        code=3,
    ),
]
