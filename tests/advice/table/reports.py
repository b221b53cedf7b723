"""What is said of a whole run: `report`, `evaluate`, `urdf`."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from unittest import mock

from scenewright.cli.main import run
from scenewright.stages.report.outlook import Facts, outlook

from tests.advice.inputs import golden, room
from tests.advice.rows import Tried

OUTLOOK = "stages/report/outlook.py"


def said(role: str, outcome: str = "ok", **summary: object) -> Callable[[], object]:
    """Return what says what to trust of an artifact."""
    return lambda: "\n".join(outlook({role: Facts(outcome, summary)}).lines())


def reported(*options: str) -> Callable[[], int]:
    """Return what writes a report that may have 40 kB."""

    def report() -> int:
        with mock.patch("scenewright.stages.report.stage.MAXIMUM_BYTES", 40_000):
            return run(["report", "--sequence", f"{room()}/sequence", "--out", "page", *options])

    return report


def motions() -> object:
    """Let go of a scene in MuJoCo."""
    from scenewright.stages.urdf.mujoco_settle import mujoco_motions

    return mujoco_motions(Path("scene"), 0.1)


def given_mjcf(folder: Path) -> None:
    """A scene of nothing."""
    (folder / "scene").mkdir()
    document = json.loads((Path(golden()) / "interactive_scene" / "scene.json").read_text())
    (folder / "scene" / "scene.json").write_text(json.dumps(document | {"bodies": []}))
    (folder / "scene" / "scene.mjcf.xml").write_text(
        '<mujoco><worldbody/><keyframe><key name="reconstructed"/></keyframe></mujoco>'
    )


def given_chair(folder: Path) -> None:
    """A box that is called a chair."""
    import trimesh

    (folder / "models").mkdir()
    trimesh.creation.box((0.5, 0.5, 0.9)).export(folder / "models" / "chair.obj")


ROWS = [
    Tried(
        OUTLOOK,
        "scenewright urdf settle SCENE",
        said("interactive_scene", "unstable", reason="2 bodies fall"),
        "urdf settle {tiny}/interactive_scene",
        code=0,
        then_code=4,
    ),
    Tried(
        OUTLOOK,
        "bring masks of your own",
        said("segments", label="class-agnostic masks"),
        "segment --sequence {room}/sequence --words cup,table --out s --dry-run",
        code=0,
    ),
    Tried(
        OUTLOOK,
        "scenewright inspect LOG",
        said("sequence", frames=1, dropped=9),
        "inspect {room}/log/frames.mcap",
        code=0,
        shows="verdict      ready",
    ),
    Tried(
        OUTLOOK,
        "scenewright library add",
        said("cad_scene", cad=0, built_in=0, mesh=9),
        "library add models --class-name chair --out library",
        code=0,
        given=given_chair,
        right=lambda folder: (folder / "library" / "library.json").stat(),
    ),
    Tried(
        OUTLOOK,
        "scenewright plan",
        said("interactive_scene", settled=True, movable=3),
        "plan --scene {golden}/interactive_scene --out p --dry-run",
        code=0,
    ),
    Tried(
        "stages/report/frames.py",
        "give the --segments that were made from --sequence",
        "report --sequence {room}/sequence --segments {tiny}/segments --out page",
        "report --sequence {tiny}/sequence --segments {tiny}/segments --out page",
        code=3,
    ),
    Tried(
        "stages/report/parameters.py",
        "--sequence for example",
        "report --out page --dry-run",
        "report --sequence {room}/sequence --out page --dry-run",
    ),
    Tried(
        "stages/report/stage.py",
        "use smaller --frame-width",
        reported(),
        reported("--frames", "0", "--view-width", "240"),
        code=3,
    ),
    Tried(
        "stages/evaluate/parameters.py",
        "give at least one of --panoptic-map",
        "evaluate --out e --dry-run",
        "evaluate --panoptic-map {golden}/panoptic_map --out e --dry-run",
    ),
    Tried(
        "stages/urdf/mujoco_settle.py",
        "pip install 'scenewright[mujoco]'",
        motions,
        motions,
        code=5,
        lacks=("mujoco",),
        given=given_mjcf,
    ),
]
