"""What the chain made of a recorded room, beside what is true of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraph
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.sequence import Sequence
from scenewright.stages.evaluate import load_map, nearest_labels, stuff_classes
from scenewright.stages.evaluate.map_measures import ANY_CLASS
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.measurement.panoptic_quality import ClassQuality, intersection_over_union, panoptic_quality

from benchmarks.experiments.house.furnishing import House
from benchmarks.experiments.house.placing import Stand, joints_given, stands, true_places
from benchmarks.experiments.house.recording import Recording, class_of
from benchmarks.experiments.surface.measuring import distances
from benchmarks.nested_furniture import nested
from benchmarks.steps import opened

VOXEL = 0.02
NEAR = 0.05
"""The map labels true points so far off [m]; that of `evaluate`."""
LEAST_POINTS = 100
"""A thing of which fewer points were seen counts neither way."""
LEAST_TOP = 100
"""Tops of fewer points, square centimetres, are left out."""
TOP_BAND = 0.03
"""Level points of a thing that are one top lie within so much height [m]."""
SAME = 0.5
"""IoU from which an entity is a true thing."""
CARRIES = ("supports", "contains", "carries_on_wall", "hangs_from")


@dataclass(frozen=True)
class Judged:
    """Figures of a room."""

    things: int
    matched: int
    entities: int
    pq: float
    """Class-agnostic, things only, 0..1."""
    support_hits: int
    supports_true: int
    supports_found: int
    tops: int
    tops_whole: int
    """Tops of which at least 98 % is mapped."""
    least_top: float
    """Share mapped of the worst top."""
    level_mapped: float
    """Share mapped of all level points of things and floor."""
    movable: int
    at_rest: int
    penetration_mm: float
    collisions: int
    settled: bool
    joints: int
    """Joints that move in the scene."""
    false_joints: tuple[str, ...] = ()
    """Things with joints that are none of theirs."""
    nested: tuple[str, ...] = ()
    """Furniture of which more than half the box lies in another's."""
    own: tuple[Stand, ...] = ()
    """What stands for the things that were seen, by a library that has their models."""
    missed: tuple[str, ...] = ()
    wrong_supports: tuple[str, ...] = ()
    holes: tuple[str, ...] = ()
    restless: tuple[str, ...] = ()


WHOLE = 0.98


def judge(house: House, recording: Recording, sequence: Path, run: Path, library: CadLibrary) -> Judged:
    """Compare what a run made of a sequence with the truth: `panoptic_map`, `contact_graph`, `cad_scene`,
    `interactive_scene`, and `own_scene`, the CAD scene by a library that has the models of the house, where there is
    one. `library` is that one."""
    world_from_log = np.array(opened(Sequence, sequence).info.gravity.world_from_log)
    predicted = load_map(opened(PanopticMap, run / "panoptic_map"))
    points = apply(world_from_log, recording.points.astype(float))
    labels = nearest_labels(points, predicted.surface.vertices, predicted.vertex_instances, NEAR)
    stuff = stuff_classes()
    true_names = dict(enumerate(recording.names, start=1))
    seen = {k: int(np.count_nonzero(recording.instance == k)) for k in true_names}
    things = {k for k, name in true_names.items() if class_of(name) not in stuff and seen[k] >= LEAST_POINTS}
    true_labels = np.where(np.isin(recording.instance, sorted(things)), recording.instance, 0)
    classes = {p: ANY_CLASS for p, name in predicted.classes().items() if name not in stuff}
    labels = np.where(np.isin(labels, sorted(classes)), labels, 0)  # a wall is no clock
    quality = panoptic_quality(true_labels, labels, dict.fromkeys(things, ANY_CLASS), classes, frozenset(), SAME)
    whole = quality.get(ANY_CLASS, ClassQuality())
    ious = intersection_over_union(true_labels, labels)
    name_of = {p: true_names[t] for (t, p), iou in ious.items() if iou > SAME}
    missed = tuple(sorted(true_names[k] for k in things if true_names[k] not in name_of.values()))
    layout = {name: class_of(name) for name in recording.names if class_of(name) in stuff}
    hits, wanted, found, wrong = _supports(
        house, opened(ContactGraph, run / "contact_graph"), name_of, layout, things, true_names
    )
    tops = _tops(house, recording, predicted.surface.vertices, predicted.surface.triangles, world_from_log)
    holes = tuple(f"{name} {share:.3f}" for name, share in tops if share < WHOLE)
    level = apply(world_from_log, recording.level.astype(float))
    mapped = distances(predicted.surface.vertices, predicted.surface.triangles, level) <= VOXEL
    scene = opened(InteractiveScene, run / "interactive_scene")
    summary = scene.summary
    movable = sum(body.movable for body in scene.info.bodies)
    places = true_places(house, library, world_from_log)
    joints, false_joints = joints_given(opened(CadScene, run / "cad_scene"), name_of, places)
    owned = {name: place for name, place in places.items() if name in {true_names[k] for k in things}}
    own = run / "own_scene"
    return Judged(
        things=len(things),
        matched=whole.true_positives,
        entities=whole.predicted,
        pq=whole.pq,
        support_hits=hits,
        supports_true=wanted,
        supports_found=found,
        tops=len(tops),
        tops_whole=sum(share >= WHOLE for _, share in tops),
        least_top=min((share for _, share in tops), default=1.0),
        level_mapped=float(mapped.mean()),
        movable=movable,
        at_rest=movable - int(float(summary["unstable"])),
        penetration_mm=float(summary["max_penetration_mm"]),
        collisions=int(float(summary["collisions"])),
        settled=bool(float(summary["settled"])),
        joints=joints,
        false_joints=false_joints,
        nested=nested(scene.info.bodies),
        own=stands(opened(CadScene, own), name_of, owned) if own.is_dir() else (),
        missed=missed,
        wrong_supports=wrong,
        holes=holes,
        restless=(str(summary["reason"]),) if "reason" in summary else (),
    )


def _supports(
    house: House,
    graph: ContactGraph,
    name_of: dict[int, str],
    layout: dict[str, str],
    things: set[int],
    true_names: dict[int, str],
) -> tuple[int, int, int, tuple[str, ...]]:
    """Return (hits, true edges, found edges, which are wrong) of what carries what; walls are one, as in the map."""
    of_node: dict[str, str] = {}
    for node in graph.info.nodes:
        layouts = layout.values()
        of_node[node.id] = node.class_name if node.class_name in layouts else name_of.get(node.instance, node.id)
    stuff = set(layout.values())
    found = {
        (of_node[link.source], of_node[link.target])
        for link in graph.info.links
        if link.relation in CARRIES and link.source != SCENE_NODE and of_node[link.target] not in stuff
    }
    counted = {true_names[k] for k in things}
    true = {(layout.get(t.parent, t.parent), t.name) for t in house.things if t.name in counted}
    lost = [f"{a} -> {b} missing" for a, b in true - found]
    extra = [f"{a} -> {b} not so" for a, b in found - true]
    return len(true & found), len(true), len(found), tuple(sorted(lost + extra))


def _tops(
    house: House, recording: Recording, vertices: np.ndarray, faces: np.ndarray, world_from_log: np.ndarray
) -> list[tuple[str, float]]:
    """Return (name and height, share mapped) of every level top of a thing."""
    tops = []
    for instance, name in enumerate(recording.names, start=1):
        if name in house.layout:
            continue
        points = recording.level[recording.level_instance == instance].astype(float)
        while len(points) >= LEAST_TOP:
            bins = np.round(points[:, 2] / 0.01).astype(int)
            height = np.bincount(bins - bins.min()).argmax() + bins.min()
            of_top = np.abs(points[:, 2] - height * 0.01) <= TOP_BAND / 2
            if np.count_nonzero(of_top) < LEAST_TOP:
                break
            mapped = distances(vertices, faces, apply(world_from_log, points[of_top])) <= VOXEL
            tops.append((f"{name} at {height * 0.01:.2f}", float(mapped.mean())))
            points = points[~of_top]
    return tops
