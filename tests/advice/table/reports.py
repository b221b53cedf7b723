"""What is said of a whole run: `report`, `evaluate`, `urdf`."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

from scenewright.cli.main import run
from scenewright.stages.report.outlook import Facts, outlook

from tests.advice.inputs import golden, room
from tests.advice.rows import Tried
from tests.unit.urdf.other_scenes import TABLE, cup, mjcf, urdf

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


def given_others(folder: Path) -> None:
    """Two cups on a table, as others would write them, and a folder that holds something else."""
    blocks = [TABLE, cup(0.8), cup(0.8, "mug", 0.3)]
    urdf(folder / "s.urdf", blocks)
    mjcf(folder / "s.xml", blocks)
    (folder / "full").mkdir()
    (folder / "full" / "thesis.tex").touch()


def others(path: str, says: str, first: str, then: str, **more: Any) -> Tried:
    """Return a row about `urdf protocol` on these."""
    return Tried(path, says, f"urdf protocol {first}", f"urdf protocol {then}", given=given_others, **more)


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
    others("cli/urdf_protocol_command.py", "--out", "s.urdf --out full", "s.urdf --out out"),
    others("stages/library/importing/scenes/opening.py", "--root", "s.urdf --root full", "s.urdf --root ."),
    others("stages/urdf/protocol_yield.py", "--seen", "s.urdf --seen 1", "s.urdf --seen 2"),
    others(
        "stages/urdf/protocol_text.py", "--seen N", "s.urdf", "s.urdf --seen 4", code=0, shows="yield: 2 of 4 (50.0 %)"
    ),
    others("stages/library/importing/scenes/mjcf_scene.py", "pip install", "s.xml", "s.xml", code=5, lacks=("mujoco",)),
]
