"""`poses`."""

from __future__ import annotations

from pathlib import Path

from scenewright.stages.kit.formats.trajectories import read_tum

from tests.advice.rows import NotTried, Tried

OPTIONS, STAGE, WORLD, XFEAT = (
    "stages/poses/parameters.py",
    "stages/poses/stage.py",
    "stages/poses/world.py",
    "stages/poses/xfeat.py",
)
POSES = "poses --out out --sequence {walks}/"


def no_network(folder: Path) -> None:
    (folder / "no.onnx").write_bytes(b"no network")


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
    Tried(
        OPTIONS,
        "--features needs",
        f"{POSES}unposed --features no.onnx --method sfm --dry-run",
        f"{POSES}unposed --method sfm --dry-run",
        given=no_network,
    ),
    Tried(
        XFEAT,
        "leave --features out",
        f"{POSES}unposed --features no.onnx",
        f"{POSES}unposed",
        code=3,
        given=no_network,
        right=four_poses,
    ),
    Tried(
        WORLD,
        "use --method rgbd",
        f"{POSES}unposed --method refine",
        f"{POSES}unposed --method rgbd",
        code=3,
        right=four_poses,
    ),
    NotTried(STAGE, "compare it with that of --method rgbd", "it says how to find out, and mends nothing"),
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
