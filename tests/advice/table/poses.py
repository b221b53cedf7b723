"""`poses`."""

from __future__ import annotations

from pathlib import Path

from scenewright.stages.kit.formats.trajectories import read_tum

from tests.advice.rows import Tried

OPTIONS, STAGE, WORLD = "stages/poses/parameters.py", "stages/poses/stage.py", "stages/poses/world.py"
POSES = "poses --out out --sequence {walks}/"


def four_poses(folder: Path) -> None:
    assert len(read_tum(folder / "out/trajectory.tum")[0]) == 4


ROWS = [
    Tried(
        OPTIONS,
        "--bundle-adjustment needs",
        f"{POSES}unposed --bundle-adjustment --no-use-color --dry-run",
        f"{POSES}unposed --bundle-adjustment --dry-run",
    ),
    Tried(
        OPTIONS,
        "--method sfm needs",
        f"{POSES}unposed --method sfm --no-use-color --dry-run",
        f"{POSES}unposed --method sfm --dry-run",
    ),
    Tried(
        OPTIONS,
        "--method sfm needs",
        f"{POSES}unposed --method sfm --no-use-color",
        f"{POSES}unposed --method rgbd --no-use-color",
        right=four_poses,
    ),
    *(
        Tried(
            STAGE,
            "have no colour",
            f"{POSES}colourless {asked}",
            f"{POSES}colourless --method rgbd",
            code=3,
            right=four_poses,
        )
        for asked in ("--method sfm", "--bundle-adjustment")
    ),
    *(
        Tried(
            WORLD,
            "--world upright",
            f"{POSES}unposed --world sequence",
            f"{POSES}unposed --world {world}",
            code=3,
            right=four_poses,
        )
        for world in ("upright", "first")
    ),
    Tried(
        STAGE,
        "--camera NAME",
        f"{POSES}two",
        "ingest --log {walks}/two_log/frames.mcap --camera left --out left && poses --sequence left --out out",
        code=3,
    ),
]
