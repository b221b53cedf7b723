"""CAD replacement on a real scan against alignments that people made: the sample of Scan2CAD, scene0470_00.

The scan's labels become a panoptic map (`fuse --from-mesh`), its graph, and a CAD scene from a library that holds the
six annotated models (`six`), or those among the parametric ones and a public furniture set (`among_others`). The
annotated models stand in the scan with a scale for each axis; ours have one. Read the data where it lies; without it
nothing is measured.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from pydantic import Field
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.outside import file_json
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.evaluate import (
    ModelShape,
    PartShape,
    PlacedShape,
    alignment_error,
    model_shape,
    placed_candidate,
    retrieval_rank,
    sample_triangles,
)
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.stage import Parameters
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from benchmarks.experiment import Bench, Experiment, Measure, Trial, statistic
from benchmarks.steps import made, opened

SCAN = "scene0470_00"
USUAL_HEIGHT = {"03001627": ("chair", 0.85), "04379243": ("table", 0.75), "02747177": ("bin", 0.4)}
"""ShapeNet's category -> class, and the height [m] that its models are imported with: their own unit says nothing."""
RAW_FROM_LIBRARY_FRONT = {
    "-z": np.array([[-1.0, 0, 0], [0, 0, 1], [0, 1, 0]]),
    "+z": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
}
"""Front of a y-up file as it was imported -> (3, 3) rotation, library frame (z up, front -y) from the file's."""
NEAR = 0.10
"""Surfaces this close are the same [m]: annotated models lie 2 to 5 cm off the scan."""


class Scan2CadParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data"), description="Folder with scan2cad_sample and aws_furniture")


@dataclass(frozen=True)
class Aligned:
    """One annotated model and what stands for it."""

    model: str
    decision: str
    chosen: str = ""
    rank: int | None = None
    """Place of the annotated model among the candidates."""
    translation: float | None = None
    rotation: float | None = None
    scale: float | None = None
    success: bool = False


@dataclass(frozen=True)
class Scan:
    """What came of a scan."""

    objects: tuple[Aligned, ...]


def scan_folder(bench: Bench) -> Path:
    """Folder of the sample."""
    return Path(bench.parameters.data) / "scan2cad_sample"


def seeds_of(bench: Bench, case: str) -> list[str]:
    """The scan, where it is there."""
    return [SCAN] if scan_folder(bench).is_dir() else []


def inputs(bench: Bench, trial: Trial) -> list[Path]:
    """The sample, and the furniture of others."""
    return [scan_folder(bench), Path(bench.parameters.data) / "aws_furniture"]


def read_raw(file: Path) -> trimesh.Trimesh:
    """Return all surfaces of a file of ShapeNet as one mesh, its numbers as they are."""
    mesh = trimesh.load(file, force="mesh", process=False)
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


def write_models(sample: Path, out: Path) -> Path:
    """Write the models of ShapeNet in metres, named by class, into `out`: their usual height instead of a unit box."""
    shutil.rmtree(out, ignore_errors=True)
    for source in sorted(sample.glob("shapenet-sample/*/*/models/model_normalized.obj")):
        category, identity = source.parts[-4], source.parts[-3]
        name, height = USUAL_HEIGHT[category]
        mesh = read_raw(source)
        mesh.apply_scale(height / float(np.ptp(mesh.vertices[:, 1])))
        folder = out / f"{name}_{identity}"
        folder.mkdir(parents=True)
        bare = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        (folder / f"{folder.name}.obj").write_text(str(bare.export(file_type="obj")))
    return out


def library(bench: Bench, case: str) -> Path:
    """Make the case's library and return it."""
    folder = bench.out / "work"
    words = ["library", "add", str(write_models(scan_folder(bench), folder / "shapenet")), "--up", "+y"]
    if case == "among_others":
        ours = made("library build --shapes-per-class 4 --seed 1", folder / "ours")
        furniture = Path(bench.parameters.data) / "aws_furniture"
        others = made("library add --decomposition hulls", folder / "others", furniture, "--library", ours)
        words += ["--library", str(others)]
    return made("library add --decomposition hulls", folder / case / "library", *words[2:])


def matrix(trs: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the rigid part (4, 4) and the scales (3,) of one of Scan2CAD's transforms (quaternions begin with w)."""
    w, x, y, z = trs["rotation"]
    rigid = np.eye(4)
    rigid[:3, :3] = Rotation.from_quat([x, y, z, w]).as_matrix()
    rigid[:3, 3] = trs["translation"]
    return rigid, np.array(trs["scale"], float)


def true_shape(shape: ModelShape, raw: trimesh.Trimesh, front: np.ndarray, placed: Mapping[str, Any]) -> PlacedShape:
    """Return an annotated model as it stands in the annotation's world, in the library's model frame.

    `raw`: the file's mesh; `front` (3, 3): library frame from the file's; `placed`: its transform.
    """
    low, high = shape.closed_bounds
    turned = raw.vertices @ front.T
    size = (high - low)[2] / np.ptp(turned[:, 2])
    offset = 0.5 * (low + high) - 0.5 * size * (turned.min(axis=0) + turned.max(axis=0))
    rigid, scales = matrix(placed)
    triangles = (((shape.closed_triangles - offset) / size) @ front * scales) @ front.T
    rigid[:3, :3] = rigid[:3, :3] @ front.T
    scaled = ModelShape(shape.model_id, shape.class_name, {"body": PartShape(triangles, (0.0, 0.0, 0.0))})
    return PlacedShape(scaled, rigid)


def nearest_entity(true: PlacedShape, made_map: Mapping[int, np.ndarray]) -> int | None:
    """Return the entity whose vertices and the true surface cover each other best, None where none does at all."""
    triangles = sample_triangles(true.shape.closed_triangles, 3000, np.random.default_rng(0))
    points = triangles @ true.rotation.T + true.world_from_model[:3, 3]
    tree, scores = cKDTree(points), {}
    for instance, vertices in made_map.items():
        of_entity = float(np.mean(tree.query(vertices)[0] < NEAR))
        scores[instance] = of_entity * float(np.mean(cKDTree(vertices).query(points)[0] < NEAR))
    best = max(scores, key=lambda instance: scores[instance], default=None)
    return best if best is not None and scores[best] > 0 else None


def compare(sample: Path, models: Path, panoptic_map: PanopticMap, scene: CadScene) -> tuple[Aligned, ...]:
    """Return every annotated model with what stands for it in the CAD scene."""
    told = file_json(sample / "annotation" / "example_annotation.json", 2**24)
    told = told[0] if isinstance(told, list) else told
    world_from_scan, _ = matrix(told["trs"])
    fronts = {entry["id"]: entry["front"] for entry in json.loads((models / "imports.json").read_text())["models"]}
    things = {
        entity.instance: np.asarray(read_mesh(panoptic_map.path(entity.mesh)).vertices, float)
        for entity in panoptic_map.info.entities
        if entity.class_name not in ("floor", "wall", "ceiling")
    }
    nodes = {node.instance: node.id for node in scene.graph.nodes if node.node_type != "scene"}
    replacements = {entry.node: entry for entry in scene.info.replacements}
    found = []
    for entry in told["aligned_models"]:
        name = f"{USUAL_HEIGHT[entry['catid_cad']][0]}_{entry['id_cad']}"
        file = next(sample.glob(f"shapenet-sample/*/{entry['id_cad']}/models/model_normalized.obj"))
        raw = read_raw(file)
        shape = model_shape(models / "models" / name)
        true = true_shape(shape, raw, RAW_FROM_LIBRARY_FRONT[fronts[name]], entry["trs"])
        true = PlacedShape(true.shape, np.linalg.inv(world_from_scan) @ true.world_from_model)
        entity = nearest_entity(true, things)
        replacement = None if entity is None else replacements.get(nodes.get(entity, ""))
        if replacement is None:
            found.append(Aligned(name, "missed"))
            continue
        rank = retrieval_rank(replacement, name)
        chosen = replacement.chosen if replacement.decision == "cad" else None
        if chosen is None:
            found.append(Aligned(name, replacement.decision, rank=rank))
            continue
        stands = placed_candidate(chosen, {chosen.model_id: model_shape(scene.path("models") / chosen.model_id)})
        assert stands is not None
        error = alignment_error(true, stands, is_round=entry["sym"] == "__SYM_ROTATE_UP_INF")
        right = stands.shape.class_name == shape.class_name and error.succeeds()
        figures = (error.translation, float(np.degrees(error.rotation)), error.scale)
        found.append(Aligned(name, "cad", chosen.model_id, rank, *figures, success=right))
    return tuple(found)


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Scan]]:
    """Yield what both methods make of the scan with one library."""
    sample, work = scan_folder(bench), bench.out / "work"
    models = library(bench, trials[0].case)
    panoptic_map = made("fuse --from-mesh", work / "panoptic_map", sample / "scannet-sample" / SCAN)
    graph = made("graph --panoptic-map", work / "contact_graph", panoptic_map)
    given = ["--panoptic-map", panoptic_map, "--library", models]
    for trial in trials:
        out = work / trial.case / trial.arm
        scene = made(f"cad --method {trial.arm} --contact-graph", out, graph, *given)
        yield trial, Scan(compare(sample, models, opened(PanopticMap, panoptic_map), opened(CadScene, scene)))


def share(right: Any) -> Measure:
    """Share of the annotated models for which `right` holds."""
    return Measure(lambda records: 100 * float(np.mean([right(o) for r in records for o in r.objects])), "%", False)


def middle(name: str, unit: str) -> Measure:
    """Median of an error over what was replaced."""
    figure = statistic(name, np.median)

    def of(records: Sequence[Scan]) -> float | None:
        return figure([o for record in records for o in record.objects])

    return Measure(of, unit, interval=False)


EXPERIMENT = Experiment(
    name="scan2cad",
    title="CAD replacement on a real scan with annotated models",
    simulated="Nothing: the scan is a recording, the alignments are people's (Scan2CAD's sample).",
    knows="The scan's labels, so that things are told apart; the annotated models are in the library, in another size.",
    does_not_show="More than one room and seven things, five of them chairs.",
    arms={"ours": "ours", "thesis": "thesis"},
    cases=("six", "among_others"),
    seeds_of=seeds_of,
    together=lambda trial: trial.case,
    measure=measure,
    record=Scan,
    measures={
        "objects": Measure(lambda records: float(sum(len(r.objects) for r in records)), interval=False),
        "replaced": share(lambda o: o.decision == "cad"),
        "scan2cad_success": share(lambda o: o.success),
        "true_model_first": share(lambda o: o.rank == 1),
        "true_model_among_candidates": share(lambda o: o.rank is not None),
        "translation": middle("translation", "m"),
        "rotation": middle("rotation", "degrees"),
        "scale": middle("scale", ""),
    },
    parameters=Scan2CadParameters,
    places=frozenset({"data"}),
    inputs=inputs,
    steps=("library build", "library add", "fuse", "graph", "cad"),
)
