"""Figures of the panoptic map: PQ, instance AP, accuracy and completeness of the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.panoptic_map import EntitiesFile, PanopticMap
from scenewright.stages.evaluate.mesh_distance import distances_to_mesh, surface_agreement
from scenewright.stages.evaluate.parameters import EvaluateParameters
from scenewright.stages.evaluate.point_labels import nearest_labels
from scenewright.stages.evaluate.results import Part
from scenewright.stages.evaluate.surfaces import Surface, read_surface
from scenewright.stages.evaluate.truth import TrueRoom, stuff_classes
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.measurement.average_precision import (
    Candidates,
    ClassPrecision,
    class_precision,
    mean_precision,
)
from scenewright.stages.kit.measurement.panoptic_quality import (
    ClassQuality,
    average_quality,
    average_quality_thesis_code,
    drop_small,
    intersection_over_union,
    overlaps,
    panoptic_quality,
)
from scenewright.stages.kit.measurement.tables import Cell, Table

ANY_CLASS = "any"
"""Stands for the class where classes do not count."""
NAMELESS = "object"
"""The class of class-agnostic entities."""


@dataclass(frozen=True)
class PredictedMap:
    """The panoptic map as evaluation needs it."""

    info: EntitiesFile
    surface: Surface
    vertex_instances: np.ndarray
    """(V,) instance per vertex of the surface, 0 unlabelled."""

    def classes(self) -> dict[int, str]:
        """Class of each entity."""
        return {entity.instance: entity.class_name for entity in self.info.entities}


def load_map(panoptic_map: PanopticMap) -> PredictedMap:
    """Read mesh and labels. Raises BadInput when they disagree."""
    surface = read_surface(panoptic_map.path("mesh.ply"))
    path = panoptic_map.path("mesh_labels.npz")
    instances = read_arrays(path, "instance", shapes=("V",))[0].astype(np.int64)
    if len(instances) != len(surface.vertices):
        raise BadInput(
            f"{path}: {len(instances)} labels for {len(surface.vertices)} vertices", hint="make the panoptic map again"
        )
    return PredictedMap(panoptic_map.info, surface, instances)


def label_true_points(truth: TrueRoom, predicted: PredictedMap, maximum_distance: float) -> np.ndarray:
    """Return (N,) the instance that the map gives each true visible point, 0 where it is unmapped or unlabelled."""
    return nearest_labels(truth.points, predicted.surface.vertices, predicted.vertex_instances, maximum_distance)


def measure_quality(
    part: Part, truth: TrueRoom, predicted: PredictedMap, labels: np.ndarray, parameters: EvaluateParameters
) -> dict[str, ClassQuality]:
    """PQ, SQ, RQ on the true visible points (unmapped area counts), class-agnostic PQ, and the thesis's variant.

    `labels` (N,) from `label_true_points`. Returns the sums by class.
    """
    stuff = stuff_classes()
    true_labels = truth.labelled_points()
    true_classes = {o.instance: o.class_name for o in truth.objects}
    qualities = panoptic_quality(true_labels, labels, true_classes, predicted.classes(), stuff, parameters.match_iou)
    for name, count in _entities_off_the_truth(predicted, labels).items():
        qualities[name] = qualities.get(name, ClassQuality()) + ClassQuality(false_positives=count)
    nameless = is_nameless(predicted)
    if nameless:
        part.notes.append("The masks are class-agnostic, so figures by class are undefined.")
    groups = {
        "": list(qualities.values()),
        "_stuff": [q for name, q in qualities.items() if name in stuff],
        "_thing": [q for name, q in qualities.items() if name not in stuff],
    }
    for suffix, group in groups.items():
        mean = average_quality([] if nameless else group)
        part.set(f"pq{suffix}", mean.pq)
        part.set(f"sq{suffix}", mean.sq)
        part.set(f"rq{suffix}", mean.rq)
    part.set("classes", average_quality(qualities.values()).classes)
    # Whatever the class: things only, true stuff is void (what lies on it is no mistake, walls in parts neither).
    true_things = {i: ANY_CLASS for i, name in true_classes.items() if name not in stuff}
    agnostic = panoptic_quality(
        np.where(np.isin(true_labels, sorted(true_things)), true_labels, 0),
        labels,
        true_things,
        dict.fromkeys(predicted.classes(), ANY_CLASS),
        frozenset(),
        parameters.match_iou,
    )
    agnostic_quality = agnostic.get(ANY_CLASS, ClassQuality())
    part.set("pq_class_agnostic", agnostic_quality.pq if agnostic_quality.segments else None)
    part.set("rq_class_agnostic", agnostic_quality.rq if agnostic_quality.segments else None)
    part.set("labelled_share", float(np.mean(labels[true_labels > 0] > 0)) if (true_labels > 0).any() else None)
    thesis = quality_thesis_code(truth, predicted, parameters)
    mean = average_quality_thesis_code([] if nameless else thesis.values())
    part.set("pq_thesis_code", mean.pq)
    part.set("sq_thesis_code", mean.sq)
    part.set("rq_thesis_code", mean.rq)
    rows: list[tuple[Cell, ...]] = []
    for name in sorted(set(qualities) | set(thesis)):
        q, t = qualities.get(name, ClassQuality()), thesis.get(name, ClassQuality())
        rows.append(
            (name, "stuff" if name in stuff else "thing", q.true_positives, q.false_positives, q.false_negatives)
            + ((q.pq, q.sq if q.true_positives else None, q.rq) if q.segments else (None, None, None))
            + (t.pq if t.predicted else None,)
        )
    part.tables.append(
        Table(
            "panoptic_quality",
            "Panoptic quality by class",
            ("class", "kind", "matched", "extra", "missed", "PQ", "SQ", "RQ", "PQ, thesis's variant"),
            tuple(rows),
            "Equation 2.15 on the true surface that the camera saw; unmapped area and missed classes count. The "
            "thesis's variant measures on the map's own vertices, drops small segments and leaves out classes that "
            "were never predicted.",
        )
    )
    return qualities


def is_nameless(predicted: PredictedMap) -> bool:
    """Whether the map's masks are class-agnostic: it has entities, and all of them are of class `object`."""
    names = {entity.class_name for entity in predicted.info.entities}
    return names == {NAMELESS}


def _entities_off_the_truth(predicted: PredictedMap, labels: np.ndarray) -> dict[str, int]:
    """Entities that no true point is labelled with: false positives that the points cannot show. Things only."""
    present = set(np.unique(labels).tolist())
    stuff = stuff_classes()
    result: dict[str, int] = {}
    for entity in predicted.info.entities:
        if entity.instance not in present and entity.class_name not in stuff:
            result[entity.class_name] = result.get(entity.class_name, 0) + 1
    return result


def quality_thesis_code(
    truth: TrueRoom, predicted: PredictedMap, parameters: EvaluateParameters
) -> dict[str, ClassQuality]:
    """The sums as the thesis's code forms them (PROTOCOLS section 3): on the map's labelled vertices.

    True labels move to the map's vertices by nearest neighbour, so unmapped truth never counts; segments of fewer
    points than 0.1 m^2 of 1 cm voxels (scaled to the map's voxel size) are dropped.
    """
    stuff = stuff_classes()
    true = nearest_labels(predicted.surface.vertices, truth.points, truth.instances)
    minimum = parameters.thesis_minimum_area / predicted.info.voxel_size**2
    return panoptic_quality(
        drop_small(true, minimum),
        drop_small(predicted.vertex_instances, minimum),
        {o.instance: o.class_name for o in truth.objects},
        predicted.classes(),
        stuff,
        parameters.match_iou,
    )


def measure_instances(
    part: Part, truth: TrueRoom, predicted: PredictedMap, labels: np.ndarray, parameters: EvaluateParameters
) -> dict[str, ClassPrecision]:
    """Record the instance AP by class over things; see `instance_candidates`. Returns it by class."""
    candidates = instance_candidates(truth, predicted, labels)
    result = {name: class_precision(listed, parameters.match_iou) for name, listed in candidates.items()}
    agnostic = result.pop(ANY_CLASS)
    part.set("instance_ap50_class_agnostic", agnostic.all_point)
    record_precision(part, "instance_ap50", {} if is_nameless(predicted) else result)
    part.tables.append(precision_table("instance_precision", "Instance AP at IoU 0.5 by class", result))
    return result


def instance_candidates(truth: TrueRoom, predicted: PredictedMap, labels: np.ndarray) -> dict[str, Candidates]:
    """Return what instance AP is computed from: by class of things, and `any` for all of them together.

    `labels` (N,) from `label_true_points`. Confidence is the number of points (vertices), as in the thesis's code.
    Predictions that lie for more than half on entities that were hardly seen count neither way; in the
    class-agnostic figure neither do those on true stuff.
    """
    stuff = stuff_classes()
    stuff_instances = frozenset(o.instance for o in truth.objects if o.class_name in stuff)
    on_stuff = _shares_on(truth, labels, truth.optional | stuff_instances)
    ious = intersection_over_union(truth.labelled_points(), labels)
    on_optional = _shares_on(truth, labels, truth.optional)
    things = [e for e in predicted.info.entities if e.class_name not in stuff]
    entities = [e for e in things if on_optional.get(e.instance, 0.0) <= 0.5]
    true = truth.evaluated(things_only=True)
    classes = sorted({o.class_name for o in true} | {e.class_name for e in entities})
    result: dict[str, Candidates] = {}
    for name in [*classes, ANY_CLASS]:
        columns = [o for o in true if name in (o.class_name, ANY_CLASS)]
        rows = [e for e in entities if name in (e.class_name, ANY_CLASS)]
        if name == ANY_CLASS:
            rows = [e for e in rows if on_stuff.get(e.instance, 0.0) <= 0.5]
        iou = np.array([[ious.get((o.instance, e.instance), 0.0) for o in columns] for e in rows])
        result[name] = Candidates(iou.reshape(len(rows), len(columns)), np.array([float(e.vertices) for e in rows]))
    return result


def _shares_on(truth: TrueRoom, labels: np.ndarray, instances: frozenset[int]) -> dict[int, float]:
    """Share of each predicted instance's true points that lie on the given true instances."""
    counts = overlaps(np.isin(truth.instances, sorted(instances)).astype(np.int64), labels)
    predicted = {p for _, p in counts if p}
    return {p: counts.get((1, p), 0) / (counts.get((1, p), 0) + counts.get((0, p), 0)) for p in predicted}


def record_precision(part: Part, measure: str, classes: dict[str, ClassPrecision]) -> None:
    """Record the class means in the three forms."""
    part.set(measure, mean_precision([c.all_point for c in classes.values()]))
    part.set(f"{measure}_11point", mean_precision([c.eleven_point for c in classes.values()]))
    part.set(f"{measure}_thesis_code", mean_precision([c.thesis_code for c in classes.values()]))


def precision_table(name: str, title: str, classes: dict[str, ClassPrecision]) -> Table:
    """Table of AP by class in the three forms."""
    return Table(
        name,
        title,
        ("class", "true", "predicted", "found", "AP", "AP, 11 points", "AP, thesis's code"),
        tuple(
            (k, c.true_count, c.predicted_count, c.found, c.all_point, c.eleven_point, c.thesis_code)
            for k, c in classes.items()
        ),
        "The thesis's code gives recall levels that were never reached the last precision; this inflates.",
    )


def measure_surface(
    part: Part, truth: TrueRoom, predicted: PredictedMap, threshold: float
) -> tuple[np.ndarray, np.ndarray]:
    """Accuracy (map vertices to the true surface) and completeness (true visible points to the map).

    Returns both distance arrays [m].
    """
    to_truth = distances_to_mesh(predicted.surface.vertices, truth.surface.vertices, truth.surface.triangles)
    to_map = distances_to_mesh(truth.points, predicted.surface.vertices, predicted.surface.triangles)
    agreement = surface_agreement(to_truth, to_map, threshold)
    if agreement is None:
        for measure in ("mesh_precision", "mesh_recall", "mesh_fscore"):
            part.set(measure, 0.0 if len(truth.points) else None)
        return to_truth, to_map
    part.set("accuracy_mean_mm", 1000 * agreement.accuracy_mean)
    part.set("accuracy_median_mm", 1000 * agreement.accuracy_median)
    part.set("accuracy_p95_mm", 1000 * agreement.accuracy_p95)
    part.set("completeness_mean_mm", 1000 * agreement.completeness_mean)
    part.set("mesh_precision", agreement.precision)
    part.set("mesh_recall", agreement.recall)
    part.set("mesh_fscore", agreement.fscore)
    return to_truth, to_map
