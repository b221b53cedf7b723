"""A scan of others, annotated or bare, as a panoptic map: `fuse --from-mesh`, without frames and masks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.errors import BadInput
from scenewright.schemas.panoptic_map import EntitiesFile, Entity, PanopticMap
from scenewright.schemas.vocabulary import Vocabulary, load_vocabulary
from scenewright.stages.fuse.annotated_scan import AnnotatedScan, instances_by_class, read_scan
from scenewright.stages.fuse.bare_scan import told_apart
from scenewright.stages.fuse.parameters import FuseParameters
from scenewright.stages.fuse.point_surface import thinned, tiles_of_points
from scenewright.stages.fuse.scan_frame import in_metres_and_upright
from scenewright.stages.kit.formats.map_files import cut_mesh, face_labels, mesh_name, write_arrays
from scenewright.stages.kit.formats.ply_files import ColoredMesh, canonical_order, write_ply
from scenewright.stages.kit.labels import ANYTHING, OWN, Label, LabelSet, load_label_set, plain, read_label_file
from scenewright.stages.kit.stage import Context

KEPT_FACES = 2_000_000
"""Finer meshes are thinned to one vertex in each cube of --voxel-size."""
LEVEL = np.cos(np.radians(0.5))
"""Least cosine between the floor's normal and z for a scan that is left as it is turned: half a degree; by eye."""
VOID = frozenset(
    {"mirror", "otherstructure", "paper", "picture", "poster", "remove", "unannotated", "undefined", "unknown"}
)
"""Names that say of a surface that it is nothing, or nothing but what hangs flat on a wall (docs/SEGMENTATION.md)."""
GAP = 0.3
"""Height between the parts of a thing that was labelled by class alone [m]."""
SMALLEST_FLOOR = 100
"""Vertices."""


def run_from_mesh(scan: Path, labels: Path | None, *, parameters: FuseParameters, context: Context) -> PanopticMap:
    """Write the map of a scan: an entity for each label of a known class, all of a stuff class in one; without any
    label, what geometry tells apart.

    What is not in the vocabulary is an `object`, and counted. Raises BadInput when the scan is of no known layout,
    broken, or nothing says what its labels are.
    """
    with context.progress.step("read the scan"):
        labelled_scan = in_metres_and_upright(read_scan(scan), parameters.unit, parameters.up, scan, context.logger)
        bare = not (labelled_scan.labels > 0).any()
        if bare:
            axis = labelled_scan.up if parameters.up == "declared" else parameters.up
            geometry = "things are told apart by geometry"
            context.logger.warning("%s: nothing of it is labelled: %s, %s is up (--up AXIS)", scan, geometry, axis)
            labelled_scan = told_apart(labelled_scan, parameters.voxel_size, parameters.unnamed_area, scan)
        label_set = read_label_file(labels) if labels is not None else None
        table = classes_of(labelled_scan, label_set, scan)
    vocabulary = load_vocabulary()
    classes = {number: vocabulary.by_name(name).id for number, name in table.classes.items()}
    if table.unknown:
        context.logger.warning(
            "%s: %d of its names are in no table and become `%s`: %s",
            scan,
            len(table.unknown),
            ANYTHING,
            ", ".join(table.unknown[:10]),
        )
    with context.progress.step("entities"):
        surface, instance, class_of = _entities(labelled_scan, classes, vocabulary, parameters, context)
        turned = upright(surface.vertices, instance, class_of, vocabulary, context)
        if not labelled_scan.are_instances:
            instance = joined_parts(turned, instance, class_of, vocabulary)
        surface, order = canonical_order(replace(surface, vertices=turned))
        instance = instance[order]
        entities, meshes, instance = _list_entities(surface, instance, class_of, vocabulary, parameters)
    with context.progress.step("write the map"):
        (context.output / "entities").mkdir(parents=True, exist_ok=True)
        EntitiesFile(
            voxel_size=parameters.voxel_size,
            truncation_distance=parameters.truncation_voxels * parameters.voxel_size,
            frames_integrated=0,
            segmentation=f"{'geometry alone' if bare else 'annotated by hand'}, {labelled_scan.layout}",
            entities=tuple(entities),
        ).write(context.output / "entities.json")
        write_ply(context.output / "mesh.ply", surface)
        for number, mesh in meshes.items():
            write_ply(context.output / mesh_name(number), mesh)
        table_of = np.zeros(max(class_of, default=0) + 1, dtype=np.int32)
        for number in meshes:
            table_of[number] = class_of[number]
        instance_ids = instance.astype(np.int32)
        write_arrays(
            context.output / "mesh_labels.npz",
            {"instance": instance_ids, "segment": instance_ids, "class_id": table_of[instance_ids]},
        )
    summary = {
        "layout": labelled_scan.layout,
        "frames": 0,
        "entities": len(entities),
        "unnamed": len(table.unknown),
        "labelled_share": round(float((instance > 0).mean()), 3),
        "vertices": len(surface.vertices),
        "faces": len(surface.faces),
    }
    return PanopticMap(context.output, outcome="ok" if entities else "empty", summary=summary)


@dataclass(frozen=True)
class Named:
    """Label -> class; labels that are left out are void."""

    classes: Mapping[int, str]
    unknown: tuple[str, ...]


def classes_of(scan: AnnotatedScan, given: LabelSet | None, where: Path) -> Named:
    """Return the class of every label that occurs: by its name in the given table, else in the vocabulary and its
    synonyms, else `object`; where the scan has no names, by its number in the given table.

    Raises BadInput when labels occur that nothing names.
    """
    vocabulary_labels, classes, unknown = load_label_set(OWN), {}, set()
    present = [int(label) for label in np.unique(scan.labels) if label > 0]
    nameless = []
    for label in present:
        name = scan.names.get(label)
        label_entry: Label | None
        if name is None:
            label_entry = given.by_id(label) if given else None
            if label_entry is None:
                nameless.append(label)
                continue
        else:
            label_entry = (given.find(name) if given else None) or vocabulary_labels.find(name)
            if label_entry is None and plain(name) in VOID:
                continue
        if label_entry is None:
            unknown.add(str(name))
        if label_entry is None or label_entry.class_name:
            classes[label] = label_entry.class_name if label_entry else ANYTHING
    if nameless and not classes:
        raise BadInput(
            f"{where}: nothing says what label {nameless[0]} is ({len(nameless)} such labels)",
            hint="name them by id: --labels FILE.toml as in data/labels",
        )
    return Named(classes, tuple(sorted(unknown | ({f"{len(nameless)} without a name"} if nameless else set()))))


def _entities(
    scan: AnnotatedScan,
    classes: Mapping[int, int],
    vocabulary: Vocabulary,
    parameters: FuseParameters,
    context: Context,
) -> tuple[ColoredMesh, np.ndarray, dict[int, int]]:
    """Return the surface [m], the instance (V,) of its vertices, 0 none, and instance -> class id."""
    stuff = {entry.id for entry in vocabulary.classes if entry.kind == "stuff"}
    labels = np.where(np.isin(scan.labels, sorted(classes)), scan.labels, 0)
    # A stuff class is one instance: every wall is the wall.
    first: dict[int, int] = {}
    merged = {label: first.setdefault(c, label) if c in stuff else label for label, c in sorted(classes.items())}
    keys = np.array([0, *sorted(merged)])
    labels = np.array([0, *(merged[label] for label in sorted(merged))])[np.searchsorted(keys, labels)]
    if scan.are_instances:
        numbers, inverse = np.unique(np.append(0, labels), return_inverse=True)
        instance, class_of = inverse[1:], {k: classes[int(n)] for k, n in enumerate(numbers) if k}
    else:
        stuff_labels = frozenset(label for label, c in classes.items() if c in stuff)
        instance, label_of = instances_by_class(labels, scan.faces, stuff_labels)
        class_of = {k: classes[label] for k, label in label_of.items()}
    vertices, faces, colors = scan.vertices, scan.faces, scan.colors
    if not len(faces):
        vertices, faces, colors, instance = tiles_of_points(vertices, colors, instance, parameters.voxel_size)
    elif len(faces) > KEPT_FACES:
        before = len(faces)
        vertices, faces, colors, instance = thinned(vertices, faces, colors, instance, parameters.voxel_size)
        context.logger.info(
            "%d faces are more than %d: thinned to %d, one vertex in each cube of %g m",
            before,
            KEPT_FACES,
            len(faces),
            parameters.voxel_size,
        )
    return ColoredMesh(vertices.astype(np.float32), faces.astype(np.int32), colors), instance, class_of


def upright(
    vertices: np.ndarray, instance: np.ndarray, class_of: Mapping[int, int], vocabulary: Vocabulary, context: Context
) -> np.ndarray:
    """Return vertices (V, 3) turned so that the plane of the annotated floor is level and under everything else.

    Scans are upright or not, as their authors liked; without a floor they stay as they are.
    """
    floor = [k for k, c in class_of.items() if c == vocabulary.by_name("floor").id]
    ground = vertices[np.isin(instance, floor)].astype(float)
    if len(ground) < SMALLEST_FLOOR:
        context.logger.warning("no floor is annotated: z is taken to be up (--up AXIS)")
        return vertices
    middle = np.median(ground, axis=0)
    normal = np.linalg.svd(ground[:: max(1, len(ground) // 20000)] - middle, full_matrices=False)[2][2]
    others = vertices[(instance > 0) & ~np.isin(instance, floor)]
    if len(others) and np.median((others - middle) @ normal) < 0 or not len(others) and normal[2] < 0:
        normal = -normal
    if normal[2] >= LEVEL:
        return vertices
    axis = np.cross(normal, [0.0, 0.0, 1.0])
    if np.linalg.norm(axis) < 1e-9:
        axis = np.array([1.0, 0.0, 0.0])
    axis /= np.linalg.norm(axis)
    angle = float(np.arccos(np.clip(normal[2], -1, 1)))
    skew = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turn = np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew
    context.logger.info("turned by %.1f degrees, so that the annotated floor is level", np.degrees(angle))
    return (vertices @ turn.T).astype(np.float32)


def joined_parts(
    vertices: np.ndarray, instance: np.ndarray, class_of: Mapping[int, int], vocabulary: Vocabulary
) -> np.ndarray:
    """Return instances (V,) in which parts of one class that lie over each other are one thing.

    A chair whose legs were not seen is a seat over a foot: the smaller of two footprints (boxes along x and y) lies by
    half within the other, and at most GAP [m] of height is between them. The larger part gives its number.
    """
    size = np.bincount(instance)
    low, high = np.full((len(size), 3), np.inf), np.full((len(size), 3), -np.inf)
    np.minimum.at(low, instance, vertices)
    np.maximum.at(high, instance, vertices)
    things = [k for k, c in class_of.items() if vocabulary.by_id(c).kind == "thing" and c and size[k]]
    unnamed = vocabulary.by_name(ANYTHING).id
    into = np.arange(len(size))
    instances_of_class: dict[int, list[int]] = {}
    for k in sorted(things, key=lambda k: (-size[k], k)):
        same = instances_of_class.setdefault(class_of[k], [])
        host = next((j for j in same if class_of[k] != unnamed and _over_each_other(low, high, k, j)), None)
        if host is None:
            same.append(k)
        else:
            into[k] = host
            low[host], high[host] = np.minimum(low[host], low[k]), np.maximum(high[host], high[k])
    return into[instance]


def _over_each_other(low: np.ndarray, high: np.ndarray, small: int, large: int) -> bool:
    shared = np.clip(np.minimum(high[small], high[large]) - np.maximum(low[small], low[large]), 0, None)[:2].prod()
    small_area = max(float((high[small] - low[small])[:2].prod()), 1e-6)
    gap = max(low[small, 2] - high[large, 2], low[large, 2] - high[small, 2])
    return bool(shared >= 0.5 * small_area and gap <= GAP)


def _list_entities(
    surface: ColoredMesh,
    instance: np.ndarray,
    class_of: Mapping[int, int],
    vocabulary: Vocabulary,
    parameters: FuseParameters,
) -> tuple[list[Entity], dict[int, ColoredMesh], np.ndarray]:
    """Return the entities that are large enough, their meshes by instance, and the instances (V,) that are left."""
    of_face = face_labels(instance, surface.faces)
    order = np.argsort(of_face, kind="stable")
    numbers, starts = np.unique(of_face[order], return_index=True)
    entities, meshes = [], {}
    for number, members in zip(numbers.tolist(), np.split(order, starts[1:]), strict=True):
        if not number:
            continue
        mesh = cut_mesh(surface, members)
        if len(mesh.vertices) < parameters.minimum_entity_voxels:
            continue
        meshes[number] = mesh
        entities.append(
            Entity(
                instance=number,
                class_name=vocabulary.by_id(class_of[number]).name,
                mesh=mesh_name(number),
                vertices=len(mesh.vertices),
                triangles=len(mesh.faces),
                box_minimum=as_vector(mesh.vertices.min(axis=0)),
                box_maximum=as_vector(mesh.vertices.max(axis=0)),
                confidence=1.0,
                observations=0,
                segments=(number,),
            )
        )
    return entities, meshes, np.where(np.isin(instance, sorted(meshes)), instance, 0)
