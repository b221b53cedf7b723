"""Meshes and points that others labelled, as one kind of thing: ScanNet, Replica, SceneNN, a PLY or NPZ with labels.

Every layout is a function of LAYOUTS: it looks at the files and returns a scan, or None when they are not its own.
Units are metres everywhere.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_text
from scenewright.stages.fuse.parts import connected_parts
from scenewright.stages.kit.formats.mesh_files import read_cloud, read_mesh
from scenewright.stages.kit.formats.numpy_files import read_all_arrays, read_arrays
from scenewright.stages.kit.formats.scenenn_annotation import read_annotation
from scenewright.stages.kit.known_names import AxisName

LARGEST_JSON = 2**28
"""Most bytes of a JSON file."""
MOST_FACES = 30_000_000
"""Most faces of a scan; a guard against what does not fit into memory, by eye."""
MOST_POINTS = 20_000_000
"""Most points of a scan without faces; a guard against what does not fit into memory, by eye."""
BARE = (".ply", ".obj", ".stl", ".glb")
"""Meshes that are read without labels."""
HINT = "docs/MASKS.md lists the layouts of labelled meshes"
NYU40 = (
    "wall",
    "floor",
    "cabinet",
    "bed",
    "chair",
    "sofa",
    "table",
    "door",
    "window",
    "bookshelf",
    "picture",
    "counter",
    "blinds",
    "desk",
    "shelves",
    "curtain",
    "dresser",
    "pillow",
    "mirror",
    "floor mat",
    "clothes",
    "ceiling",
    "books",
    "refrigerator",
    "television",
    "paper",
    "towel",
    "shower curtain",
    "box",
    "whiteboard",
    "person",
    "night stand",
    "toilet",
    "sink",
    "lamp",
    "bathtub",
    "bag",
    "otherstructure",
    "otherfurniture",
    "otherprop",
)
"""Names of the labels 1..40 of `.labels.ply`."""


@dataclass(frozen=True)
class AnnotatedScan:
    """vertices (V, 3) float64 [m], faces (F, 3) int64 (none: points), colors (V, 3) uint8, labels (V,) int64 (0: not
    annotated)."""

    layout: str
    vertices: np.ndarray
    faces: np.ndarray
    colors: np.ndarray
    labels: np.ndarray
    names: Mapping[int, str]
    """Label -> what its annotators call it; a label without a name is not in it."""
    are_instances: bool
    """Whether a label is one thing; else it is a class, and its things are what hangs together."""
    up: AxisName = "+z"
    """Axis that the format of the file has up."""


def read_scan(root: Path) -> AnnotatedScan:
    """Read a folder or a file of one of the LAYOUTS.

    Raises BadInput when it is of none, broken, or larger than MOST_FACES or MOST_POINTS.
    """
    files = [root] if root.is_file() else sorted(file for file in root.rglob("*") if file.is_file())
    for read_layout in LAYOUTS:
        scan = read_layout(files)
        if scan is not None:
            break
    else:
        meshes = sorted({file.name for file in files if file.suffix.lower() in BARE})
        if len(meshes) > 1:
            several = f"{root}: {len(meshes)} meshes without labels, {', '.join(meshes[:3])}"
            raise BadInput(several, hint="name one of them: --from-mesh FILE")
        raise BadInput(f"{root}: no labelled mesh or points that are read here", hint=HINT)
    if len(scan.faces) > MOST_FACES or len(scan.vertices) > max(MOST_POINTS, 3 * MOST_FACES):
        raise BadInput(
            f"{root}: {len(scan.faces)} faces, at most {MOST_FACES} are read", hint="simplify the mesh first"
        )
    return scan


def instances_by_class(
    labels: np.ndarray, faces: np.ndarray, whole: frozenset[int]
) -> tuple[np.ndarray, dict[int, int]]:
    """Return the instance (V,) int64 of each vertex, 0 none, and instance -> label, from labels (V,) that are classes.

    Each part of the surface (F, 3) that hangs together is an instance; labels in `whole` are one, wherever they are.
    """
    components = connected_parts(labels, faces)
    key = np.where(np.isin(labels, sorted(whole)), -1, components)
    pairs, inverse = np.unique(np.stack([labels, key], axis=1), axis=0, return_inverse=True)
    numbers = np.where(pairs[:, 0] > 0, np.cumsum(pairs[:, 0] > 0), 0)
    return numbers[inverse.reshape(-1)], {int(n): int(label) for n, (label, _) in zip(numbers, pairs, strict=True) if n}


def _scannet(files: list[Path]) -> AnnotatedScan | None:
    """`<scene>.aggregation.json`, `<scene>...segs.json` and the mesh whose vertices these segments number."""
    groups = [file for file in files if file.name.endswith(".aggregation.json")]
    if not groups:
        return None
    # Both resolutions may lie there; the segments decide which mesh is meant, and the coarser one comes first.
    segments = sorted((f for f in files if f.name.endswith(".segs.json")), key=lambda f: ("_2." not in f.name, f.name))
    group = next((file for file in groups if "_2." in file.name), groups[0])
    if not segments:
        raise BadInput(f"{group}: its .segs.json is not beside it", hint=HINT)
    of_vertex = _integers(_json(segments[0]), "segIndices", segments[0])
    meshes = [file for file in files if file.suffix == ".ply" and not file.name.endswith(".labels.ply")]
    stem = segments[0].name.split(".")[0]
    meshes.sort(key=lambda file: (file.stem != stem, file.name))
    if not meshes:
        raise BadInput(f"{group}: no mesh is beside it", hint=f"put {stem}.ply there")
    mesh, _, _ = _read(meshes[0])
    if len(of_vertex) != len(mesh.vertices):
        raise BadInput(
            f"{segments[0]}: {len(of_vertex)} segments for the {len(mesh.vertices)} vertices of {meshes[0].name}",
            hint="take the mesh and the segments of one resolution (_vh_clean_2)",
        )
    rows = _json(group).get("segGroups")
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise BadInput(f"{group}: lists no segGroups", hint=HINT)
    top = int(of_vertex.max(initial=0))
    label_of = np.zeros(top + 1, dtype=np.int64) if top < 2**28 else None
    if label_of is None or (of_vertex < 0).any():
        raise BadInput(f"{segments[0]}: segments that are not in 0..2^28", hint=HINT)
    names = {}
    for number, row in enumerate(rows, start=1):
        segment_ids = _integers(row, "segments", group)
        label_of[segment_ids[(segment_ids >= 0) & (segment_ids <= top)]] = number
        if isinstance(row.get("label"), str) and row["label"].strip():
            names[number] = row["label"]
    return _scan("ScanNet", mesh, label_of[of_vertex], names, True)


def _replica(files: list[Path]) -> AnnotatedScan | None:
    """`habitat/mesh_semantic.ply`, whose faces have `object_id`, and `habitat/info_semantic.json`."""
    meshes = [file for file in files if file.name == "mesh_semantic.ply"]
    infos = [file for file in files if file.name == "info_semantic.json"]
    if not meshes:
        return None
    if not infos:
        raise BadInput(f"{meshes[0]}: info_semantic.json is not beside it", hint=HINT)
    mesh, _, columns = _read(meshes[0])
    data = _json(infos[0])
    rows = data.get("objects")
    names = {
        row["id"] + 1: row["class_name"]
        for row in (rows if isinstance(rows, list) else ())
        if isinstance(row, dict) and type(row.get("id")) is int and isinstance(row.get("class_name"), str)
    }
    if not names:
        raise BadInput(f"{infos[0]}: lists no objects with id and class_name", hint=HINT)
    polygons = columns["vertex_indices"] if "vertex_indices" in columns else columns.get("vertex_index")
    if "object_id" not in columns or polygons is None or polygons.dtype.names is None:
        raise BadInput(f"{meshes[0]}: its faces have no `object_id`, or are not all alike in a binary PLY", hint=HINT)
    corners = polygons[polygons.dtype.names[-1]].astype(np.int64)
    faces = np.concatenate([corners[:, [0, k, k + 1]] for k in range(1, corners.shape[1] - 1)])
    owner = np.tile(columns["object_id"].astype(np.int64) + 1, corners.shape[1] - 2)
    # A vertex where two objects meet becomes one of each.
    flat = faces.astype(np.int64) * (int(owner.max(initial=0)) + 1) + np.maximum(owner, 0)[:, None]
    keys, first, places = np.unique(flat, return_index=True, return_inverse=True)
    vertices, colors = np.asarray(mesh.vertices)[faces.ravel()[first]], _colors(mesh)[faces.ravel()[first]]
    labels = keys % (int(owner.max(initial=0)) + 1)
    return AnnotatedScan("Replica", vertices, places.reshape(-1, 3), colors, labels, names, True)


def _scenenn(files: list[Path]) -> AnnotatedScan | None:
    """`<scene>.ply` with a vertex property `label`, and `<scene>.xml`."""
    for xml in (file for file in files if file.suffix == ".xml"):
        ply = next((file for file in files if file.suffix == ".ply" and file.stem == xml.stem), None)
        if ply is None:
            continue
        mesh, columns, _ = _read(ply)
        if "label" not in columns:
            raise BadInput(f"{ply}: its vertices have no property `label`", hint=HINT)
        annotation = read_annotation(xml)
        names = {
            number: entry.nyu_class or entry.text
            for number, entry in annotation.items()
            if entry.nyu_class or entry.text
        }
        return _scan("SceneNN", mesh, _whole(columns["label"], ply), names, True)
    return None


def _labelled_ply(files: list[Path]) -> AnnotatedScan | None:
    """A PLY whose vertices have `label`: `.labels.ply` of ScanNet (NYU40), or numbers that --labels names."""
    plys = sorted((f for f in files if f.suffix == ".ply"), key=lambda f: (not f.name.endswith(".labels.ply"), f.name))
    for file in plys:
        if (cloud := read_cloud(file, hint=HINT)) is not None:
            if cloud.labelled:
                raise BadInput(
                    f"{file}: points with labels and without faces do not say which of them are one thing",
                    hint="write an NPZ: points, instance, id, classes (docs/MASKS.md)",
                )
            continue
        mesh, columns, _ = _read(file)
        if "label" in columns:
            is_nyu = file.name.endswith(".labels.ply")
            names = dict(enumerate(NYU40, start=1)) if is_nyu else {}
            return _scan("NYU40 labels" if is_nyu else "labels", mesh, _whole(columns["label"], file), names, False)
    return None


def _points(files: list[Path]) -> AnnotatedScan | None:
    """An NPZ with `points` (N, 3), `instance` (N,), 0 none, `id` (K,) and `classes` (K,) names, `colors` if wanted; or
    points alone."""
    for file in (f for f in files if f.suffix == ".npz"):
        arrays = read_all_arrays(file, hint=HINT)
        if "instance" not in arrays and "points" in arrays:
            labels, ids = np.zeros(len(arrays["points"]), np.int64), np.zeros(0, np.int64)
            points, classes = arrays["points"], np.zeros(0, "U1")
        else:
            points, labels, ids, classes = read_arrays(file, "points", "instance", "id", "classes", hint=HINT)
        if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind != "f" or len(points) > MOST_POINTS:
            raise BadInput(
                f"{file}: `points` is {points.dtype} {points.shape}, not (N, 3) up to {MOST_POINTS}", hint=HINT
            )
        if labels.shape != (len(points),) or ids.ndim != 1 or ids.shape != classes.shape or ids.dtype.kind not in "ui":
            raise BadInput(f"{file}: `instance` {labels.shape}, `id` {ids.shape}, `classes` {classes.shape}", hint=HINT)
        if not np.isfinite(points).all():
            raise BadInput(f"{file}: points are not finite", hint=HINT)
        names = {int(n): str(name) for n, name in zip(ids, classes, strict=True)} if classes.dtype.kind == "U" else {}
        try:
            (colors,) = read_arrays(file, "colors", hint=HINT)
        except BadInput:
            colors = np.full(points.shape, 160, dtype=np.uint8)
        if colors.shape != points.shape or colors.dtype != np.uint8:
            raise BadInput(f"{file}: `colors` is {colors.dtype} {colors.shape}, not (N, 3) of bytes", hint=HINT)
        none = np.zeros((0, 3), dtype=np.int64)
        return AnnotatedScan("points", points.astype(float), none, colors, _whole(labels, file), names, True)
    return None


def _bare(files: list[Path]) -> AnnotatedScan | None:
    """One mesh whose vertices have no labels, or a PLY of points alone."""
    meshes = [file for file in files if file.suffix.lower() in BARE]
    if len(meshes) != 1:
        return None
    file = meshes[0]
    if file.suffix.lower() == ".ply" and (cloud := read_cloud(file, hint=HINT)) is not None:
        none, unlabelled = np.zeros((0, 3), dtype=np.int64), np.zeros(len(cloud.points), np.int64)
        return AnnotatedScan("points", cloud.points, none, cloud.colors, unlabelled, {}, False)
    mesh = read_mesh(file, hint=HINT)
    scan = _scan("mesh", mesh, np.zeros(len(mesh.vertices), np.int64), {}, False)
    return replace(scan, up="+y") if file.suffix.lower() == ".glb" else scan


LAYOUTS: tuple[Callable[[list[Path]], AnnotatedScan | None], ...] = (
    _scannet,
    _replica,
    _scenenn,
    _labelled_ply,
    _points,
    _bare,
)


def _read(path: Path) -> tuple[trimesh.Trimesh, dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return a mesh and the columns of its file's vertices and faces by name."""
    mesh = read_mesh(path, hint=HINT)
    raw = mesh.metadata.get("_ply_raw", {})
    return mesh, _columns(raw.get("vertex")), _columns(raw.get("face"))


def _columns(element: Any) -> dict[str, np.ndarray]:
    data = element.get("data") if isinstance(element, dict) else None
    if isinstance(data, np.ndarray):
        return {name: data[name] for name in data.dtype.names or ()}
    return {name: np.asarray(data[name]) for name in data} if isinstance(data, dict) else {}


def _colors(mesh: trimesh.Trimesh) -> np.ndarray:
    painted = getattr(mesh.visual, "vertex_colors", None)
    return (
        np.asarray(painted, dtype=np.uint8)[:, :3]
        if painted is not None
        else np.full(mesh.vertices.shape, 160, np.uint8)
    )


def _scan(
    layout: str, mesh: trimesh.Trimesh, labels: np.ndarray, names: Mapping[int, str], single: bool
) -> AnnotatedScan:
    vertices, faces = np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int64)
    return AnnotatedScan(layout, vertices, faces, _colors(mesh), labels, names, single)


def _whole(labels: np.ndarray, path: Path) -> np.ndarray:
    integers = np.asarray(labels).reshape(-1).astype(np.int64)
    if (integers != np.asarray(labels).reshape(-1)).any() or (integers < 0).any():
        raise BadInput(f"{path}: labels that are not integers from 0 on", hint=HINT)
    return integers


def _json(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > LARGEST_JSON:
            raise BadInput(f"{path}: larger than {LARGEST_JSON} bytes", hint=HINT)
        data = json.loads(file_text(path, LARGEST_JSON, hint=HINT))
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror or error}", hint=HINT) from None
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{path}: no JSON ({str(error).splitlines()[0]:.80})", hint=HINT) from None
    if not isinstance(data, dict):
        raise BadInput(f"{path}: no JSON object", hint=HINT)
    return data


def _integers(row: Mapping[str, Any], key: str, path: Path) -> np.ndarray:
    values = row.get(key)
    if not isinstance(values, list) or not all(type(value) is int and abs(value) < 2**31 for value in values):
        raise BadInput(f"{path}: `{key}` is not a list of integers", hint=HINT)
    return np.array(values, dtype=np.int64)
