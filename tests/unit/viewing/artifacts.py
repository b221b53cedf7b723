"""Small artifacts of every kind, sealed with a manifest as the runner does."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import trimesh
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from scenewright.schemas.base import as_transform
from scenewright.schemas.cad_scene import CadCandidate, CadSceneFile, Replacement
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.evaluation import MetricsFile, ReportFile
from scenewright.schemas.ground_truth import GroundTruthFile, TrueObject
from scenewright.schemas.kinds import KINDS
from scenewright.schemas.manifest import MANIFEST_NAME, InputRecord, Manifest
from scenewright.schemas.packing import (
    PackingArea,
    PackingAttempt,
    PackingBox,
    PackingFile,
    PackingInstanceFile,
    PackingObstacle,
    PackingStep,
)
from scenewright.schemas.panoptic_map import EntitiesFile, Entity
from scenewright.schemas.plan import Failure, PlanFile, PlannedAction
from scenewright.schemas.segments import FrameSegment, FrameSegments, SegmentsFile
from scenewright.schemas.sequence import Sequence
from scenewright.stages.engine.digests import content_digest, record_files
from scenewright.stages.kit.formats.frames import FrameWriter
from scenewright.stages.kit.formats.masks import write_panoptic_zip
from scenewright.stages.kit.formats.scene_bundle import write_scene_bundle
from scenewright.stages.kit.formats.trajectories import write_tum

from tests.unit.disparity.pairs import pair, write_folder
from tests.unit.disparity.running import matched
from tests.unit.export.sequences import export
from tests.unit.ingest.foxglove_logs import LogWriter, compressed, transform
from tests.unit.ingest.running import ingest
from tests.unit.ingest.tiny_room import CAMERA, frames, jpeg, write_seven_scenes
from tests.unit.urdf.small_room import find, graph_of, room, small_library

CLASSES = ("table", "fridge", "cup", "bottle")


def seal(root: Path, kind: str, **inputs: Path) -> Path:
    """Write the manifest of a folder; `inputs` are role -> artifact folder."""
    records = record_files(root, KINDS[kind].undigested)
    given = []
    for role, path in inputs.items():
        made = Manifest.read(path / MANIFEST_NAME)
        relative = Path("..") / path.name
        given.append(InputRecord(role=role, kind=made.kind, digest=made.content_digest, path=relative.as_posix()))
    Manifest(
        kind=kind,
        schema_version=KINDS[kind].schema_version,
        stage="test",
        key="0" * 64,
        content_digest=content_digest(records),
        files=records,
        inputs=tuple(given),
    ).write(root / MANIFEST_NAME)
    return root


def make_sequence(run: Path) -> Path:
    """Five frames of the tiny room."""
    ingest(write_seven_scenes(run / "log", frames(5)), run / "sequence")
    return seal(run / "sequence", "sequence")


def make_disparity(run: Path) -> Path:
    """One pair of a box before a wall."""
    sequence = ingest(write_folder(run / "pairs", [pair()[:2]]), run / "pairs" / "sequence")
    matched(sequence, run / "disparity")
    return seal(run / "disparity", "disparity")


def make_segments(run: Path) -> Path:
    """Two halves in every frame: class 1, instance 3, and class 2, instance 9."""
    root = run / "segments"
    root.mkdir()
    ids = np.zeros((CAMERA.height, CAMERA.width), np.int32)
    ids[:, :40], ids[:, 50:] = 1, 2
    write_panoptic_zip(root / "panoptic.zip", [(k, ids) for k in range(5)])
    records = (
        FrameSegment(id=1, class_id=1, instance=3, is_thing=True, score=1.0, area=2880),
        FrameSegment(id=2, class_id=2, instance=9, is_thing=True, score=1.0, area=3312),
    )
    SegmentsFile(
        backend="ground-truth",
        label="test masks",
        width=CAMERA.width,
        height=CAMERA.height,
        frames=tuple(FrameSegments(frame=k, segments=records) for k in range(5)),
    ).write(root / "segments.json")
    return seal(root, "segments", sequence=run / "sequence")


def make_map(run: Path) -> Path:
    """One cube with instance 4."""
    root = run / "panoptic_map"
    (root / "entities").mkdir(parents=True)
    cube = trimesh.creation.box((1, 1, 1))
    cube.visual = trimesh.visual.ColorVisuals(cube, vertex_colors=np.tile([10, 20, 30, 255], (8, 1)).astype(np.uint8))
    cube.export(root / "mesh.ply")
    cube.export(root / "entities" / "4.ply")
    np.savez(root / "mesh_labels.npz", instance=np.full(8, 4, np.int32))
    entity = Entity(
        instance=4,
        class_name="table",
        mesh="entities/4.ply",
        vertices=8,
        triangles=12,
        box_minimum=(-0.5, -0.5, -0.5),
        box_maximum=(0.5, 0.5, 0.5),
        confidence=1.0,
        observations=5,
        segments=(1,),
    )
    EntitiesFile(
        voxel_size=0.02, truncation_distance=0.08, frames_integrated=5, segmentation="test", entities=(entity,)
    ).write(root / "entities.json")
    return seal(root, "panoptic_map")


def make_library(run: Path) -> Path:
    """A few parametric models."""
    small_library(run / "cad_library", *CLASSES)
    return seal(run / "cad_library", "cad_library")


def make_contact_graph(run: Path, library) -> Path:
    """The graph of the small room; one node has the map's mesh."""
    graph = graph_of(room(library))
    nodes = tuple(
        node.model_copy(update={"mesh": "entities/4.ply"}) if node.id == "table_3" else node for node in graph.nodes
    )
    root = run / "contact_graph"
    root.mkdir()
    ContactGraphFile(nodes=nodes, links=graph.links).write(root / "graph.json")
    return seal(root, "contact_graph", panoptic_map=run / "panoptic_map")


def make_cad_scene(run: Path, library) -> Path:
    """One node with a model, one that keeps its mesh, one of the layout."""
    import shutil

    root = run / "cad_scene"
    (root / "meshes").mkdir(parents=True)
    (root / "layout").mkdir()
    shutil.copytree(library.path("models") / "table_00", root / "models" / "table_00")
    trimesh.creation.box((1, 1, 1)).export(root / "meshes" / "cup_5.ply")
    trimesh.creation.box((4, 4, 0.01)).export(root / "layout" / "floor_1.ply")
    chosen = CadCandidate(
        model_id="table_00",
        scale=0.9,
        world_from_model=as_transform(np.eye(4)),
        matching_error=0.1,
        alignment_error=0.02,
    )
    lifted = np.eye(4)
    lifted[2, 3] = 0.1
    others = (
        chosen.model_copy(update={"world_from_model": as_transform(lifted), "matching_error": 0.3}),
        chosen.model_copy(update={"model_id": "table_99"}),
    )
    CadSceneFile(
        replacements=(
            Replacement(
                node="table_3",
                decision="cad",
                chosen=chosen,
                best_single=chosen,
                alternatives=others,
                rejected={"scale out of range": 4},
            ),
            Replacement(node="cup_5", decision="mesh", reason="nothing fits"),
            Replacement(node="floor_1", decision="layout"),
        ),
        conflicts_before=0,
        conflicts_after=0,
        iterations=0,
    ).write(root / "scene.json")
    graph_of(room(library)).write(root / "graph.json")
    return seal(root, "cad_scene")


def make_interactive_scene(run: Path, library) -> Path:
    """The small room as URDF."""
    bodies = room(library)
    (run / "interactive_scene").mkdir()
    write_scene_bundle(run / "interactive_scene", bodies, graph_of(bodies))
    return seal(run / "interactive_scene", "interactive_scene")


def make_plan(run: Path) -> Path:
    """A plan in which a cup rises by one metre and a robot link goes with it."""
    root = run / "plan"
    root.mkdir()
    with LogWriter(root / "execution.mcap") as log:
        for k in range(3):
            stamp, lifted = k * 10**9, np.eye(4)
            lifted[2, 3] = k / 2
            pair = [transform(stamp, "world", name, lifted) for name in ("cup_5", "robot/panda_hand")]
            log.write("/tf", FrameTransforms(transforms=pair), stamp)
            log.write("/execution", compressed(stamp, jpeg(frames(1)[0][0])), stamp)
    PlanFile(
        goal=("on(cup_5, table_3)",),
        planned_in="reconstructed",
        executed_in="reconstructed",
        actions=(PlannedAction(name="pick", arguments=("cup_5",), start=0, end=2, base_pose=as_transform(np.eye(4))),),
        status="executed",
    ).write(root / "plan.json")
    ContactGraphFile(nodes=(), links=()).write(root / "graph.json")
    return seal(root, "plan", scene=run / "interactive_scene")


def make_packing(run: Path) -> Path:
    """A packing of one box beside an obstacle, after a plan that failed; the arm moves by its first joint."""
    root = run / "packing"
    root.mkdir()
    box = PackingBox(name="red", width=0.04, length=0.04, height=0.07, x=0.39, y=-0.4)
    area = {"low": (0.54, -0.1), "high": (0.76, 0.1)}
    block = PackingObstacle(name="block", low=(0.6, 0.0), high=(0.65, 0.05), top=0.1)
    PackingInstanceFile(boxes=(box,), basket=PackingArea(**area), obstacles=(block,)).write(root / "instance.json")
    hit = Failure(kind="goal_in_collision", message="red is in collision with block", objects=("block", "red"))
    pick = PackingStep(name="pick", box="red", tried=True)
    bad, good = (PackingStep(name="place", box="red", x=x, y=0.0, yaw=0.0, tried=True) for x in (0.61, 0.7))
    PackingFile(
        name="mine",
        proposer="ours",
        success=True,
        proposer_calls=2,
        motion_planner_calls=3,
        attempts=(
            PackingAttempt(steps=(pick, bad.model_copy(update={"failure": hit}))),
            PackingAttempt(steps=(pick, good)),
        ),
    ).write(root / "packing.json")
    joints = np.zeros((3, 7))
    joints[:, 0] = [0.0, 0.1, 0.2]
    np.savez(root / "trajectory.npz", joints=joints, action=np.array([0, 0, 1], np.int32))
    (root / "layout.png").write_bytes(cv2.imencode(".png", np.zeros((4, 4, 3), np.uint8))[1].tobytes())
    return seal(root, "packing")


def make_ground_truth(run: Path, library) -> Path:
    """The small room with a log of the tiny one; only the drawing is under test."""
    root = run / "ground_truth"
    (root / "room").mkdir(parents=True)
    bodies = room(library)
    write_scene_bundle(root / "room", bodies, graph_of(bodies))
    graph_of(bodies).write(root / "graph.json")
    with FrameWriter(root / "log.mcap", CAMERA, labels=True) as writer:
        for k, (color, depth, pose) in enumerate(frames(3)):
            writer.write(k / 10, color, depth, pose, np.full(depth.shape, 3, np.uint16))
    np.savez(root / "visible.npz", points=np.zeros((4, 3), np.float32), instance=np.array([1, 2, 3, 3], np.int32))
    GroundTruthFile(
        seed=0,
        recipe="test",
        room_size=(4, 3, 2.5),
        camera=CAMERA,
        frame_count=3,
        depth_noise=False,
        objects=tuple(
            TrueObject(
                instance=int(body.name.rsplit("_", 1)[1]),
                name=body.name,
                class_name=body.class_name,
                world_from_model=as_transform(body.world_from_body),
                box=body.box,
            )
            for body in bodies
        ),
    ).write(root / "ground_truth.json")
    return seal(root, "ground_truth")


def make_evaluation(run: Path) -> Path:
    """Two figures, a table and a plot."""
    root = run / "evaluation"
    (root / "tables").mkdir(parents=True)
    (root / "plots").mkdir()
    MetricsFile(label="test", metrics={"map/pq": 0.5, "map/ap": None}).write(root / "metrics.json")
    (root / "tables" / "map.md").write_text("| a |\n|---|\n")
    (root / "plots" / "map.png").write_bytes(b"\x89PNG\r\n")
    return seal(root, "evaluation")


def make_report(run: Path) -> Path:
    """An empty page."""
    root = run / "report"
    root.mkdir()
    ReportFile(title="test", sections=(), sources={}).write(root / "report.json")
    (root / "report.html").write_text("<html></html>")
    return seal(root, "report")


def make_trajectory(run: Path) -> Path:
    """Three poses."""
    root = run / "trajectory"
    root.mkdir()
    write_tum(root / "trajectory.tum", np.arange(3.0), np.array([pose for _, _, pose in frames(3)]))
    return seal(root, "trajectory")


def make_export(run: Path) -> Path:
    """The sequence as TUM."""
    export(Sequence(run / "sequence"), run / "exported_sequence", layout="tum")
    return seal(run / "exported_sequence", "exported_sequence", sequence=run / "sequence")


__all__ = ["find"]
