"""Small artifacts of tableware, sealed as the runner does: a cup is stacked on another and both are taken."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.tableware_detections import TablewareDetection, TablewareDetectionsFile
from scenewright.schemas.tableware_plan import (
    GraspFields,
    StackFields,
    StackGraspFields,
    TablewareAction,
    TablewarePlanFile,
    TablewareStep,
    TimesOfActions,
)
from scenewright.schemas.tableware_scene import TablewareItem, TablewareSceneFile
from scenewright.schemas.tableware_trial import (
    EvaluatedPolicy,
    TablewareEvaluationFile,
    TablewareTrialFile,
    TrialCounts,
    TrialStep,
)
from scenewright.stages.tableware.world.shape_files import write_shapes

from tests.unit.viewing.artifacts import seal

ITEMS = (
    TablewareItem(name="cup_1", kind="cup", position=(0.1, 0.0, 0.0)),
    TablewareItem(name="cup_2", kind="cup", position=(-0.1, 0.0, 0.0)),
)
LIFT = GraspFields(items=("cup_1",), p_G=(0.14, 0.0, 0.075), theta_G=0.0)
TAKE = GraspFields(items=("cup_2",), p_G=(-0.06, 0.0, 0.075), theta_G=0.0)
ACTION = TablewareAction(
    name="stack_grasp",
    seconds=18.5,
    risk=0.0,
    u_SG=StackGraspFields(u_S=StackFields(u_G=LIFT, onto="cup_2", p_L=(-0.1, 0.0, 0.02), theta_L=0.0), u_G=TAKE),
)
TIMES = TimesOfActions(trip=10.1, stack=8.4, pull=5.7)
PICTURE = cv2.imencode(".png", np.zeros((4, 4, 3), np.uint8))[1].tobytes()


def make_tableware(run: Path) -> None:
    """Write one artifact of each kind."""
    scene = run / "tableware_scene"
    scene.mkdir()
    TablewareSceneFile(
        tier="tier0_cups",
        seed=0,
        light="usual",
        colors="dark_on_white",
        items=ITEMS,
        camera=Camera(width=4, height=4, fx=4.0, fy=4.0, cx=1.5, cy=1.5),
        world_from_camera=as_transform(np.eye(4)),
    ).write(scene / "scene.json")
    (scene / "color.png").write_bytes(PICTURE)
    np.savez(scene / "depth.npz", depth=np.ones((4, 4), np.float32))
    write_shapes(scene)
    seal(scene, "tableware_scene")
    make_detections(run)
    make_plan(run)
    make_trial(run)
    make_evaluation(run)


def make_detections(run: Path) -> Path:
    """Write what was seen of a cup and of something unknown."""
    root = run / "tableware_detections"
    root.mkdir()
    cup = TablewareDetection(kind="cup", position=(0.1, 0.0, 0.0), lip=0.08, confidence=0.9)
    thing = TablewareDetection(kind=None, position=(0.2, 0.1, 0.0), lip=0.05, extent=0.04, confidence=0.0)
    TablewareDetectionsFile(statement="1 item, 1 thing", items=(cup, thing)).write(root / "detections.json")
    (root / "overlay.png").write_bytes(PICTURE)
    return seal(root, "tableware_detections")


def make_plan(run: Path) -> Path:
    """Write a plan of one action."""
    root = run / "tableware_plan"
    root.mkdir()
    TablewarePlanFile(
        policy="stack",
        source="truth",
        times=TIMES,
        chances="exact",
        items=ITEMS,
        steps=(TablewareStep(action=ACTION, before=ITEMS),),
        seconds=18.5,
        trips=1,
        expected_seconds=18.5,
        expected_trips=1.0,
        expected_objects_per_trip=2.0,
        risk=0.0,
        draws=1,
        statement="2 items to clear",
    ).write(root / "plan.json")
    (root / "plan.txt").write_text("2 items to clear\n")
    (root / "strip.png").write_bytes(PICTURE)
    return seal(root, "tableware_plan", scene=run / "tableware_scene")


def make_trial(run: Path) -> Path:
    """Write a trial of one action."""
    root = run / "tableware_trial"
    root.mkdir()
    TablewareTrialFile(
        policy="stack",
        simulator="fast",
        sight="truth",
        times=TIMES,
        chances="exact",
        statement="2 of 2 items",
        counts=TrialCounts(
            seconds=18.5, trips=1, moved=2, pulls=0, stacks=1, dropped=0, left=0, objects_per_trip=2.0, failure=""
        ),
        steps=(TrialStep(action=ACTION, start=0.0, end=18.5, before=ITEMS, after=(), binned=("cup_1", "cup_2")),),
    ).write(root / "trial.json")
    (root / "trial.txt").write_text("2 of 2 items\n")
    (root / "keyframes.png").write_bytes(PICTURE)
    write_shapes(root)
    return seal(root, "tableware_trial", scene=run / "tableware_scene")


def make_evaluation(run: Path) -> Path:
    """Write a comparison of one policy."""
    root = run / "tableware_evaluation"
    root.mkdir()
    row = EvaluatedPolicy(
        policy="stack",
        tier="tier0_cups",
        tables=1,
        trials=1,
        time=55.0,
        time_interval=(55.0, 55.0),
        objects_per_trip=2.0,
        objects_per_trip_interval=(2.0, 2.0),
        time_ratio=None,
        objects_per_trip_ratio=None,
        failure_rate=0.0,
        failures_policy=0,
        failures_perception=0,
    )
    TablewareEvaluationFile(chances="exact", sight="truth", delay=0.0, draws=1, first_scene=0, rows=(row,)).write(
        root / "results.json"
    )
    (root / "table.md").write_text("| policy |\n|---|\n| stack |\n")
    return seal(root, "tableware_evaluation")
