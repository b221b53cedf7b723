"""The steps of `tableware`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from scenewright.cli.main import run

from tests.advice.rows import NotTried, Tried

DETECT, DETECT_STAGE = "stages/tableware/detect_parameters.py", "stages/tableware/detect_stage.py"
OPTIONS, SIMULATORS = "stages/tableware/parameters.py", "stages/tableware/simulators.py"
RECTIFYING, SEEING = "stages/tableware/vision/rectifying.py", "stages/tableware/vision/seeing.py"
DISHES = "[cup]\nheight = 0.096\nrim_radius = 0.041\n"
BOWL = "[bowl]\nheight = 0.055\nrim_radius = 0.08\n"
GRIPPER = "[gripper]\nopening = 0.07\njaw_height = 0.045\nfinger_width = 0.022\n"
DETECTING = "tableware detect {table} --out out"
BY_FILE = "tableware detect {table}/color.png --camera {table}/camera.json --out out --depth"
PLANNING = "tableware plan --out out --dry-run"
SIMULATING = "tableware simulate --scene {golden}/tableware_scene --out out --dry-run"


def dishes_files(folder: Path) -> None:
    (folder / "cup.toml").write_text(DISHES)
    (folder / "gripper.toml").write_text(GRIPPER)
    (folder / "more.toml").write_text(DISHES + BOWL)


def found(folder: Path) -> dict[str, Any]:
    told = json.loads((folder / "out/detections.json").read_text())
    (thing,) = told["items"] or told["outlines"]
    return dict(thing)


def an_outline(folder: Path) -> None:
    assert found(folder)["box"]


def the_cylinder(folder: Path) -> None:
    thing = found(folder)
    assert abs(thing["lip"] - 0.055) < 0.002 and max(map(abs, thing["position"][:2])) < 0.005, thing


def the_bowl(folder: Path) -> None:
    assert found(folder)["kind"] == "bowl"


def a_scene_for_another_hand(folder: Path) -> None:
    dishes_files(folder)
    assert run(["tableware", "scene", "--tier", "tier0_cups", "--dishes", "gripper.toml", "--out", "scene"]) == 0


def cleared(folder: Path) -> None:
    assert json.loads((folder / "out/trial.json").read_text())["counts"]["left"] == 0


def bowls_alone(folder: Path) -> None:
    items = json.loads((folder / "out/scene.json").read_text())["items"]
    assert {item["kind"] for item in items} == {"bowl"}


ROWS = [
    Tried(DETECT, "--picture-width is for", f"{DETECTING} --picture-width 1", DETECTING, right=the_cylinder),
    Tried(
        DETECT,
        "--sizes estimated needs",
        f"{DETECTING} --photograph --sizes estimated",
        f"{DETECTING} --sizes estimated",
        right=the_cylinder,
    ),
    Tried(DETECT, "reads colour alone", f"{DETECTING} --photograph --overhead", f"{DETECTING} --overhead"),
    Tried(
        DETECT_STAGE,
        "and --sizes estimated not to go by it",
        f"{DETECTING} --dishes cup.toml --sizes estimated",
        f"{DETECTING} --dishes gripper.toml --sizes estimated",
        code=3,
        given=dishes_files,
    ),
    Tried(
        DETECT_STAGE,
        "no camera.json",
        "tableware detect {table}/color.png --depth {table}/depth.npy --out out",
        "tableware detect {table}/color.png --depth {table}/depth.npy --camera {table}/camera.json --out out",
        code=3,
        right=the_cylinder,
    ),
    Tried(
        DETECT_STAGE,
        "(--picture-width)",
        f"{DETECTING} --photograph",
        f"{DETECTING} --photograph --picture-width 1.66",
        code=4,
        then_code=4,
        right=the_bowl,
    ),
    Tried(
        SEEING,
        "not a table in metres",
        f"{BY_FILE} {{table}}/../millimetres.npy",
        f"{BY_FILE} {{table}}/../millimetres.npy --depth-scale 0.001",
        code=3,
        right=the_cylinder,
    ),
    Tried(
        RECTIFYING,
        "--depth-scale",
        f"{BY_FILE} {{table}}/depth.npy --depth-scale 0.1",
        f"{BY_FILE} {{table}}/depth.npy --depth-scale 1",
        code=3,
        right=the_cylinder,
    ),
    Tried(
        SEEING,
        "there is no depth image",
        "tableware detect {table}/color.png --camera {table}/camera.json --out out",
        "tableware detect {table}/color.png --camera {table}/camera.json --photograph --out out",
        code=3,
        then_code=4,
        right=an_outline,
    ),
    Tried(OPTIONS, "nothing to plan from", PLANNING, f"{PLANNING} --detections {{golden}}/tableware_detections"),
    Tried(
        OPTIONS,
        "both say what is there",
        f"{PLANNING} --detections {{golden}}/tableware_detections --scene {{golden}}/tableware_scene",
        f"{PLANNING} --scene {{golden}}/tableware_scene",
    ),
    Tried(
        OPTIONS,
        "--source truth is for",
        f"{PLANNING} --detections {{golden}}/tableware_detections --source truth",
        f"{PLANNING} --detections {{golden}}/tableware_detections",
    ),
    Tried(OPTIONS, "--delay", f"{SIMULATING} --simulator physics --delay 5", f"{SIMULATING} --simulator physics"),
    Tried(
        OPTIONS,
        "without looking",
        f"{SIMULATING} --plan {{golden}}/tableware_plan --sight image",
        f"{SIMULATING} --plan {{golden}}/tableware_plan",
    ),
    Tried(
        OPTIONS,
        "there is no policy",
        "tableware evaluate --policies pile --out out --dry-run",
        "tableware evaluate --policies random_piles --out out --dry-run",
    ),
    Tried(
        "stages/tableware/world/scenes.py",
        "--dishes",
        "tableware scene --tier tier0_bowls --dishes cup.toml --out out",
        "tableware scene --tier tier0_bowls --dishes more.toml --out out",
        given=dishes_files,
        right=bowls_alone,
    ),
    Tried(
        SIMULATORS,
        "the standard hand",
        "tableware simulate --scene scene --simulator physics --out out",
        "tableware simulate --scene scene --simulator fast --out out",
        code=3,
        given=a_scene_for_another_hand,
        right=cleared,
    ),
    Tried(
        SIMULATORS,
        "has no physics here",
        "tableware simulate --scene {golden}/tableware_scene --simulator physics --out out",
        "tableware simulate --scene {golden}/tableware_scene --simulator fast --out out",
        code=5,
        lacks=("scenewright.stages.tableware.simulation.physics_trial",),
        right=cleared,
    ),
    NotTried(
        "stages/tableware/training/thesis_times/train.py",
        "scenewright train",
        "how a file of data/ was made, as it says",
    ),
]
