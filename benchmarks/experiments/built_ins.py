"""Built-ins of `cad` where no model fits: what stands for counters, cabinets and fridges, beside the box and the mesh.

Generated rooms, recorded twice with doors and drawers opened or shut in between (`moving`), are replaced with a
library without any model, so that everything that may be built in has to be. Arms, each for the things that became
built-ins: `ours`; `box`, the box that the contact graph has of a thing; `mesh`, the boxes over its mesh that the
exported scene has where nothing stands for it. Cases: the true masks, and patches without names, as from a segmenter
that knows nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import open3d as o3d
import trimesh
from scenewright.schemas.articulations import Articulations
from scenewright.schemas.cad_library import CadLibrary, LibraryFile
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph, GraphNode
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.stages.cad import is_built_in, may_be_built_in
from scenewright.stages.kit.formats.cad_models import load_collision_parts, part_transforms, posed_collision, read_model
from scenewright.stages.kit.formats.entity_meshes import load_entity_mesh
from scenewright.stages.kit.geometry.box_cover import cover_with_boxes
from scenewright.stages.kit.geometry.boxes import box_rotation, box_yaw
from scenewright.stages.kit.geometry.transforms import apply, transform_from_yaw
from scipy.spatial import cKDTree

from benchmarks.experiment import Bench, Experiment, Measure, Trial
from benchmarks.experiments.moving import FRAMES, OPENED, PLACE, SIZE, true_motions
from benchmarks.generated_rooms import STEPS, make_library, make_room
from benchmarks.steps import opened, step, unrecorded

TUNING = ("kitchen-40",)
REPORTING = (*(f"kitchen-{seed}" for seed in range(1700, 1704)), "office-1700", "bedroom-1700")
MASKS = {"masks": "ground-truth", "patches": "geometric"}
SAMPLES = 3000
"""Points on the surface of what stands for a thing."""
FAR, FAR_AWAY = 0.1, 10.0
"""Distances are cut off here; where nothing moved, everything is so far from it [m]."""
OWN = 0.03
"""True surface that was seen within this of a thing's mesh is the thing's [m]."""
LEVEL, SAME_LEVEL = 0.95, 0.02
"""Cosine from which on true surface is level; a level is kept where something level lies so near [m]."""


@dataclass(frozen=True)
class Stood:
    """What stands for the built-ins of one room, by one arm."""

    eligible: int
    """Things that may be built in by class and size, and of these the ones that were."""
    built: int
    seen: float
    """Sum over the built-ins of the mean distance [m] from the true surface that was seen ..."""
    made: float
    """... and of that from the surface that stands for it to any true surface."""
    level: float
    """Seen level surface (points), and of it what has a level place near by."""
    level_kept: float
    pieces: int
    """Convex pieces."""
    leaves: int
    """Joints, and of these the ones where nothing was moved in truth."""
    false_leaves: int


def empty_library(folder: Path) -> CadLibrary:
    """Write a library without models."""
    folder.mkdir(parents=True, exist_ok=True)
    LibraryFile(seed=0, models=()).write(folder / "library.json")
    return CadLibrary(folder)


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Stood]]:
    """Yield what every arm puts in the place of one room's built-ins."""
    room = make_room(Path(bench.out, "rooms"), trials[0].seed, FRAMES, size=SIZE, opened=OPENED)
    case, out = trials[0].case, Path(bench.out, "scenes", trials[0].seed)
    sequence = room.sequence
    articulations = step("articulate", out / "articulations", sequence=sequence)
    segments = step("segment", out / case / "segments", {"backend": MASKS[case]}, sequence=sequence)
    panoptic_map = step(
        "fuse", out / case / "panoptic_map", sequence=sequence, segments=segments, articulations=articulations
    )
    graph = step("graph", out / case / "contact_graph", panoptic_map=panoptic_map)
    scene: CadScene = unrecorded(
        "cad",
        out / case / "cad_scene",
        {"surroundings": False},
        contact_graph=opened(ContactGraph, graph),
        panoptic_map=opened(PanopticMap, panoptic_map),
        library=empty_library(out / "empty_library"),
        articulations=opened(Articulations, articulations),
    )
    truth = opened(GroundTruth, room.ground_truth)
    world_from_log = np.array(opened(SequenceArtifact, room.sequence).info.gravity.world_from_log)
    library = opened(CadLibrary, make_library(Path(bench.out, "rooms")))
    moved = [motion.middle for motion in true_motions(truth, library, world_from_log)]
    nodes = opened(ContactGraph, graph).info.nodes
    judged = Judge(truth, world_from_log, opened(PanopticMap, panoptic_map), scene)
    for trial in trials:
        yield trial, judged.of(trial.arm, nodes, moved)


class Judge:
    """Holds what stands for things against the true surface."""

    def __init__(
        self, truth: GroundTruth, world_from_log: np.ndarray, panoptic_map: PanopticMap, scene: CadScene
    ) -> None:
        mesh = trimesh.load_mesh(truth.path("mesh.ply"), process=False)
        mesh.apply_transform(world_from_log)
        self._true = _rays(mesh)
        with np.load(truth.path("visible.npz"), allow_pickle=False) as archive:
            self._seen = apply(world_from_log, archive["points"].astype(float))
        ids = self._true.compute_closest_points(_tensor(self._seen))["primitive_ids"].numpy()
        self._up = mesh.face_normals[ids][:, 2] > LEVEL
        self._map, self._scene = panoptic_map, scene
        self._chosen = {entry.node: entry.chosen for entry in scene.info.replacements if entry.chosen is not None}

    def of(self, arm: str, nodes: Sequence[GraphNode], moved: Sequence[np.ndarray]) -> Stood:
        """Judge an arm; `moved`: where parts were that moved in truth (3,)."""
        eligible = [n for n in nodes if n.node_type in ("rigid", "articulated") and n.mesh and may_be_built_in(n)]
        total = Stood(len(eligible), 0, 0.0, 0.0, 0.0, 0.0, 0, 0, 0)
        for node in eligible:
            if node.id in self._chosen and is_built_in(self._model(node)):
                one = self._one(arm, node, moved)
                summed = {name: getattr(total, name) + getattr(one, name) for name in vars(one) if name != "eligible"}
                total = Stood(eligible=total.eligible, **summed)
        return total

    def _model(self, node: GraphNode) -> Any:
        return read_model(self._scene.path("models") / self._chosen[node.id].model_id)

    def _one(self, arm: str, node: GraphNode, moved: Sequence[np.ndarray]) -> Stood:
        mesh = load_entity_mesh(self._map.path(str(node.mesh)))
        pieces = self._pieces(arm, node, mesh)
        whole = cast(trimesh.Trimesh, trimesh.util.concatenate(pieces))
        points, faces = trimesh.sample.sample_surface(whole, SAMPLES, seed=0)
        inner = np.zeros(len(points), bool)
        for piece in pieces:
            inner |= (points @ piece.face_normals.T < (piece.triangles[:, 0] * piece.face_normals).sum(1) - 1e-4).all(1)
        level = whole.triangles[whole.face_normals[:, 2] > LEVEL]
        own = cKDTree(mesh.vertices[np.unique(mesh.faces)]).query(self._seen)[0] < OWN
        seen, up = self._seen[own], self._seen[own & self._up]
        leaves = [] if arm != "ours" else self._leaves(node)
        far = [
            min([float(np.linalg.norm(places - middle, axis=1).min()) for middle in moved], default=FAR_AWAY)
            for places in leaves
        ]
        return Stood(
            eligible=0,
            built=1,
            seen=float(_distance(_rays(whole), seen).mean()) if len(seen) else 0.0,
            made=float(_distance(self._true, points[~inner]).mean()),
            level=float(len(up)),
            level_kept=float(np.count_nonzero(_distance(_rays_of(level), up) < SAME_LEVEL)) if len(level) else 0.0,
            pieces=len(pieces),
            leaves=len(leaves),
            false_leaves=sum(away > PLACE for away in far),
        )

    def _pieces(self, arm: str, node: GraphNode, mesh: Any) -> list[trimesh.Trimesh]:
        """Return the convex pieces that stand for a thing, in the world."""
        assert node.box is not None
        if arm == "box":
            piece = trimesh.creation.box(extents=node.box.size)
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = box_rotation(node.box), node.box.center
            return [piece.apply_transform(pose)]
        if arm == "mesh":
            yaw = box_yaw(node.box)
            surface = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
            turn = transform_from_yaw(yaw, np.zeros(3))
            covers = [trimesh.creation.box(bounds=(c - s / 2, c + s / 2)) for c, s in cover_with_boxes(surface, yaw)]
            return [piece.apply_transform(turn) for piece in covers]
        chosen = self._chosen[node.id]
        folder = self._scene.path("models") / chosen.model_id
        pieces = posed_collision(folder, self._model(node), chosen.joints, chosen.scale)
        return [piece.apply_transform(np.array(chosen.world_from_model)) for piece in pieces]

    def _leaves(self, node: GraphNode) -> list[np.ndarray]:
        """Return where the middles of the parts are that move, shut and as the log left them (2, 3) each."""
        chosen, model = self._chosen[node.id], self._model(node)
        parts = load_collision_parts(self._scene.path("models") / model.id)
        world = np.array(chosen.world_from_model)
        found = []
        for joint in model.joints:
            middle = np.asarray(parts[joint.part][0].vertices).mean(axis=0)[None]
            poses = [part_transforms(model, values)[joint.part] for values in ({}, chosen.joints)]
            found.append(np.concatenate([apply(world, apply(pose, middle)) for pose in poses]))
        return found


def _tensor(points: np.ndarray) -> Any:
    return o3d.core.Tensor(np.ascontiguousarray(points, dtype=np.float32))  # type: ignore[call-overload]


def _rays(mesh: trimesh.Trimesh) -> Any:
    return _rays_of(mesh.triangles)


def _rays_of(triangles: np.ndarray) -> Any:
    scene = o3d.t.geometry.RaycastingScene()
    corners = np.asarray(triangles).reshape(-1, 3)
    order = o3d.core.Tensor(np.arange(len(corners), dtype=np.uint32).reshape(-1, 3))  # type: ignore[call-overload]
    scene.add_triangles(_tensor(corners), order)
    return scene


def _distance(scene: Any, points: np.ndarray) -> np.ndarray:
    if len(points) == 0:
        return np.zeros(0)
    return np.minimum(scene.compute_distance(_tensor(points)).numpy(), FAR)


def per_built(name: str, unit: str, factor: float = 1.0) -> Measure:
    """Return a mean over all built-ins."""

    def figure(records: Sequence[Any]) -> float | None:
        built = sum(record.built for record in records)
        return factor * sum(getattr(record, name) for record in records) / built if built else None

    return Measure(figure, unit)


def count(name: str) -> Measure:
    """Return a sum."""
    return Measure(lambda records: float(sum(getattr(record, name) for record in records)), interval=False)


def _level(records: Sequence[Any]) -> float | None:
    whole = sum(record.level for record in records)
    return 100.0 * sum(record.level_kept for record in records) / whole if whole else None


EXPERIMENT = Experiment(
    name="built_ins",
    title="What stands for things that no model fits",
    simulated="Generated rooms, a structured-light camera's noise; doors and drawers are opened or shut half-way.",
    knows="Exact poses; the true masks with their classes, or none; no CAD model at all.",
    does_not_show="Real rooms, where walls are askew and worktops glossy; how often a built-in is wanted. Things that "
    "became no built-in are in no mean. The generated furniture is made of boards itself.",
    arms={"ours": "built-in", "box": "its box", "mesh": "boxes over its mesh"},
    cases=tuple(MASKS),
    tuning=TUNING,
    reporting=REPORTING,
    together=lambda trial: (trial.case, trial.seed),
    measure=measure,
    record=Stood,
    measures={
        "eligible": count("eligible"),
        "built": count("built"),
        "seen": per_built("seen", "mm", 1000.0),
        "made": per_built("made", "mm", 1000.0),
        "level_kept": Measure(_level, "%"),
        "pieces": per_built("pieces", ""),
        "leaves": count("leaves"),
        "false_leaves": count("false_leaves"),
    },
    quick_seeds=1,
    steps=(*STEPS, "articulate", "segment", "fuse", "graph", "cad"),
)
