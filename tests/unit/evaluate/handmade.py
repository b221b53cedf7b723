"""A room made by hand: ground truth, and a reconstruction of it that may be perfect or wrong in chosen ways."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.base import as_transform
from scenewright.schemas.cad_scene import CadCandidate, CadScene, CadSceneFile, Replacement
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraph, ContactGraphFile, GraphNode
from scenewright.schemas.ground_truth import GroundTruth, GroundTruthFile, TrueObject
from scenewright.schemas.interactive_scene import InteractiveScene, InteractiveSceneFile, SceneBody
from scenewright.schemas.panoptic_map import EntitiesFile, Entity, PanopticMap
from scenewright.schemas.plan import Check, Failure, Plan, PlanFile, PlannedAction
from scenewright.schemas.scene_parts import Box, Camera, Joint, Relation
from scenewright.schemas.segments import FrameSegment, FrameSegments, Segments, SegmentsFile
from scenewright.schemas.sequence import Gravity, LabelEntry, Sequence, SequenceCamera, SequenceFile
from scenewright.stages.kit.formats.frames import FrameWriter
from scenewright.stages.kit.formats.masks import write_panoptic_zip
from scenewright.stages.kit.formats.trajectories import write_tum
from scenewright.stages.kit.geometry.boxes import box_from_bounds
from scenewright.stages.kit.geometry.transforms import look_at

CAMERA = Camera(width=64, height=48, fx=60.0, fy=60.0, cx=31.5, cy=23.5)
LABEL = "ground-truth masks, corruption 0.2"


@dataclass(frozen=True)
class Thing:
    """One box-shaped entity."""

    instance: int
    class_name: str
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    parent: int
    """Instance of what carries it; 0 for the scene."""
    relation: str = "supports"
    model_id: str | None = None
    joints: dict[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Node id."""
        return f"{self.class_name}_{self.instance}"

    @property
    def box(self) -> Box:
        """Its box."""
        return box_from_bounds(np.array(self.low), np.array(self.high))

    @property
    def node_type(self) -> str:
        """Kind of graph node."""
        return {"floor": "layout", "wall": "layout", "cabinet": "articulated"}.get(self.class_name, "rigid")

    def mesh(self) -> trimesh.Trimesh:
        """A finely triangulated box."""
        box = trimesh.creation.box(bounds=[self.low, self.high])
        return box.subdivide_to_size(0.08)


ROOM = (
    Thing(1, "floor", (-2, -2, -0.02), (2, 2, 0.0), 0),
    Thing(2, "wall", (-2, 2, 0), (2, 2.04, 2.4), 0),
    Thing(3, "table", (0, 0, 0), (1.2, 0.8, 0.75), 1, model_id="table_a"),
    Thing(4, "cup", (0.4, 0.3, 0.75), (0.5, 0.4, 0.86), 3, model_id="cup_a"),
    Thing(5, "chair", (-1.2, -0.5, 0), (-0.7, 0, 0.9), 1, model_id="chair_a"),
    Thing(6, "cabinet", (-1.8, 1.5, 0), (-1.0, 1.98, 1.0), 1, model_id="cabinet_a", joints={"door": 1.2}),
    Thing(7, "bottle", (-1.6, 1.6, 0.3), (-1.5, 1.7, 0.5), 6, relation="contains", model_id="bottle_a"),
)


def surface_points(things: tuple[Thing, ...], spacing: float = 0.03) -> tuple[np.ndarray, np.ndarray]:
    """Points on the boxes' surfaces and the instance of each, the same for the same box whatever else is there."""
    points, instances = [], []
    for thing in things:
        seed = zlib.crc32(repr((thing.low, thing.high)).encode())
        count = max(200, int(thing.mesh().area / spacing**2))
        sampled, _ = trimesh.sample.sample_surface(thing.mesh(), count, seed=seed)
        points.append(np.asarray(sampled))
        instances.append(np.full(count, thing.instance))
    return np.concatenate(points), np.concatenate(instances).astype(np.int32)


def graph_of(things: tuple[Thing, ...]) -> ContactGraphFile:
    """The contact graph of the things; a parent that is not among them is replaced by the scene."""
    names = {thing.instance: thing.name for thing in things}
    nodes = [GraphNode(id=SCENE_NODE, instance=0, class_name="scene", node_type="scene")]
    links = []
    for t in things:
        nodes.append(
            GraphNode(
                id=t.name,
                instance=t.instance,
                class_name=t.class_name,
                node_type=t.node_type,
                mesh=f"entities/{t.instance}.ply",
                box=t.box,
                box_observed=t.box,
            )
        )
        links.append(
            Relation(source=names.get(t.parent, SCENE_NODE), target=t.name, relation=t.relation, confidence=1.0)
        )
    return ContactGraphFile(nodes=tuple(nodes), links=tuple(links))


def poses(count: int = 6) -> np.ndarray:
    """(N, 4, 4) world_from_camera of a short walk."""
    return np.array([look_at(np.array([-1.5 + 0.3 * k, -1.8, 1.5]), np.array([0.2, 0.6, 0.6])) for k in range(count)])


def make_ground_truth(
    root: Path, things: tuple[Thing, ...] = ROOM, unseen: frozenset[int] = frozenset()
) -> GroundTruth:
    """Ground truth of the room; `unseen` instances have no visible point."""
    root.mkdir(parents=True)
    points, instances = surface_points(things)
    seen = ~np.isin(instances, sorted(unseen))
    np.savez(root / "visible.npz", points=points[seen].astype(np.float32), instance=instances[seen])
    trimesh.util.concatenate([thing.mesh() for thing in things]).export(root / "mesh.ply")
    objects = tuple(
        TrueObject(
            instance=t.instance,
            name=t.name,
            class_name=t.class_name,
            model_id=t.model_id,
            joints=t.joints,
            world_from_model=as_transform(model_pose(t)),
            box=t.box,
            visible_pixels=0 if t.instance in unseen else 999,
        )
        for t in things
    )
    GroundTruthFile(
        seed=3,
        recipe="handmade",
        room_size=(4.0, 4.0, 2.4),
        camera=CAMERA,
        frame_count=6,
        depth_noise=False,
        objects=objects,
    ).write(root / "ground_truth.json")
    graph_of(things).write(root / "graph.json")
    write_tum(root / "trajectory.tum", np.arange(6) * 0.1, poses())
    make_interactive_scene(root / "room", things)
    return GroundTruth(root)


def model_pose(thing: Thing) -> np.ndarray:
    """Where a model stands: bottom centre of the box."""
    pose = np.eye(4)
    pose[:3, 3] = [(thing.low[0] + thing.high[0]) / 2, (thing.low[1] + thing.high[1]) / 2, thing.low[2]]
    return pose


def make_map(root: Path, things: tuple[Thing, ...] = ROOM, voxel_size: float = 0.02) -> PanopticMap:
    """A map whose surface is that of the things."""
    (root / "entities").mkdir(parents=True)
    meshes = [thing.mesh() for thing in things]
    entities = []
    for thing, mesh in zip(things, meshes, strict=True):
        mesh.export(root / "entities" / f"{thing.instance}.ply")
        entities.append(
            Entity(
                instance=thing.instance,
                class_name=thing.class_name,
                mesh=f"entities/{thing.instance}.ply",
                vertices=len(mesh.vertices),
                triangles=len(mesh.faces),
                box_minimum=thing.low,
                box_maximum=thing.high,
                confidence=0.9,
                observations=5,
                segments=(thing.instance,),
            )
        )
    whole = trimesh.util.concatenate(meshes) if meshes else trimesh.Trimesh()
    if meshes:
        whole.visual.vertex_colors = np.full((len(whole.vertices), 4), 180, dtype=np.uint8)
        whole.export(root / "mesh.ply")
    else:
        header = "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\n"
        (root / "mesh.ply").write_text(header + "element face 0\nproperty list uchar int vertex_indices\nend_header\n")
    labels = [np.full(len(mesh.vertices), t.instance, dtype=np.int32) for t, mesh in zip(things, meshes, strict=True)]
    instance = np.concatenate(labels) if labels else np.zeros(0, dtype=np.int32)
    np.savez(root / "mesh_labels.npz", instance=instance, segment=instance, class_id=np.zeros_like(instance))
    EntitiesFile(
        voxel_size=voxel_size,
        truncation_distance=4 * voxel_size,
        frames_integrated=6,
        segmentation=LABEL,
        entities=tuple(entities),
    ).write(root / "entities.json")
    return PanopticMap(root)


def make_graph(root: Path, graph: ContactGraphFile) -> ContactGraph:
    """A contact graph artifact."""
    root.mkdir(parents=True)
    graph.write(root / "graph.json")
    return ContactGraph(root)


def make_cad_scene(root: Path, things: tuple[Thing, ...] = ROOM, shift: float = 0.0, turn: float = 0.0) -> CadScene:
    """CAD replacement with the true models, each moved by `shift` [m] along x and turned by `turn` [rad]."""
    (root / "layout").mkdir(parents=True)
    (root / "meshes").mkdir()
    replacements = []
    for thing in things:
        if thing.node_type == "layout":
            thing.mesh().export(root / "layout" / f"{thing.name}.ply")
            replacements.append(Replacement(node=thing.name, decision="layout"))
            continue
        pose = model_pose(thing)
        pose[0, 3] += shift
        cosine, sine = np.cos(turn), np.sin(turn)
        pose[:2, :2] = [[cosine, -sine], [sine, cosine]]
        chosen = CadCandidate(
            model_id=thing.model_id,
            joints={name: value + 0.1 for name, value in thing.joints.items()},
            scale=1.0,
            world_from_model=as_transform(pose),
            matching_error=0.1,
            alignment_error=0.01,
        )
        replacements.append(Replacement(node=thing.name, decision="cad", chosen=chosen))
    CadSceneFile(replacements=tuple(replacements), conflicts_before=1, conflicts_after=0, iterations=2).write(
        root / "scene.json"
    )
    graph_of(things).write(root / "graph.json")
    return CadScene(root)


def make_interactive_scene(root: Path, things: tuple[Thing, ...] = ROOM) -> InteractiveScene:
    """scene.json and graph.json alone."""
    root.mkdir(parents=True)
    names = {thing.instance: thing.name for thing in things}
    bodies = tuple(
        SceneBody(
            name=t.name,
            class_name=t.class_name,
            movable=t.class_name in ("cup", "bottle"),
            parent=names.get(t.parent),
            relation=t.relation,
            world_from_body=as_transform(model_pose(t)),
            box=t.box,
            mass=1.0,
            joints=tuple(
                Joint(
                    name=f"{t.name}__{name}",
                    type="revolute",
                    part=f"{t.name}__{name}",
                    origin=(0, 0, 0),
                    axis=(0, 0, 1),
                    lower=0.0,
                    upper=1.6,
                )
                for name in t.joints
            ),
        )
        for t in things
    )
    InteractiveSceneFile(bodies=bodies).write(root / "scene.json")
    graph_of(things).write(root / "graph.json")
    return InteractiveScene(root)


def make_sequence(root: Path) -> Sequence:
    """Six small frames of noise."""
    root.mkdir(parents=True)
    random = np.random.default_rng(0)
    with FrameWriter(root / "frames.mcap", CAMERA) as writer:
        for k, pose in enumerate(poses()):
            color = random.integers(0, 255, (48, 64, 3), dtype=np.uint8)
            writer.write(0.1 * k, color, np.full((48, 64), 1.5, dtype=np.float32), pose)
    write_tum(root / "trajectory.tum", np.arange(6) * 0.1, poses())
    SequenceFile(
        source_format="generated",
        rule="handmade",
        camera=CAMERA,
        cameras=(SequenceCamera(name="camera", camera=CAMERA),),
        streams=("color", "depth", "pose"),
        frame_count=6,
        frames_in_log=7,
        drops={"no depth": 1},
        gravity=Gravity(method="given", world_from_log=as_transform(np.eye(4))),
        label_table=(LabelEntry(instance=1, class_name="floor"),),
        end_time=0.5,
    ).write(root / "sequence.json")
    return Sequence(root)


def make_segments(root: Path, label: str = LABEL) -> Segments:
    """Two segments a frame: floor below, table above."""
    root.mkdir(parents=True)
    image = np.ones((48, 64), dtype=np.int32)
    image[:20, 10:50] = 2
    write_panoptic_zip(root / "panoptic.zip", ((k, image) for k in range(6)))
    segments = (
        FrameSegment(id=1, class_id=1, instance=1, is_thing=False, score=1.0, area=int((image == 1).sum())),
        FrameSegment(id=2, class_id=5, instance=2, is_thing=True, score=0.8, area=int((image == 2).sum())),
    )
    SegmentsFile(
        backend="ground-truth",
        label=label,
        corruption=0.2,
        width=64,
        height=48,
        frames=tuple(FrameSegments(frame=k, segments=segments) for k in range(6)),
    ).write(root / "segments.json")
    return Segments(root)


def make_plan(root: Path, detail: str = "the cup stands on the table") -> Plan:
    """An executed plan with one check that holds and one that does not, and one key frame."""
    from PIL import Image

    (root / "keyframes").mkdir(parents=True)
    Image.new("RGB", (64, 48), (90, 120, 160)).save(root / "keyframes" / "0_pick.png")
    PlanFile(
        goal=("on(cup_4, table_3)", "closed(cabinet_6)"),
        planned_in="reconstructed",
        executed_in="ground_truth",
        actions=(PlannedAction(name="pick", arguments=("cup_4",), start=0, end=5, base_pose=as_transform(np.eye(4))),),
        failures=(Failure(kind="no_path", message="first base pose blocked", numbers={"tries": 3}),),
        checks=(
            Check(condition="on(cup_4, table_3)", holds=True, detail=detail, numbers={"gap": 0.001}),
            Check(condition="closed(cabinet_6)", holds=False, detail="door at 0.4 rad", numbers={"angle": 0.4}),
        ),
        status="executed",
    ).write(root / "plan.json")
    graph_of(ROOM).write(root / "graph.json")
    return Plan(root)
