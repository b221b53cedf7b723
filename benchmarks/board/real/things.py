"""Which true things a map holds, under which name, where they stand in the scene, and which things are none."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.ground_truth import TrueObject
from scenewright.schemas.vocabulary import UNNAMED, load_vocabulary
from scenewright.stages.evaluate import PredictedMap, TrueRoom, label_true_points, nearest_labels, point_overlaps
from scenewright.stages.kit.formats.cad_models import posed_mesh, read_model
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.geometry.transforms import apply
from scipy.spatial import cKDTree

from benchmarks.board.real.records import Tally, Things
from benchmarks.graph_scores import OPTIONS

LARGE = 0.5
"""Things whose longest edge is at least so long are large [m]."""
ONE_PIECE = 0.5
"""Intersection over union, over true points that were seen, from which on an entity is the thing."""
SAMPLES = 20_000
"""Points on the surface of a model in the scene."""


def is_layout(class_name: str) -> bool:
    """Whether a class bounds the room."""
    return load_vocabulary().by_name(class_name).is_layout


def is_large(thing: TrueObject) -> bool:
    """Whether a person calls a thing large."""
    return max(thing.box.size) >= LARGE


def true_things(truth: TrueRoom) -> list[TrueObject]:
    """The things that were seen, without what bounds the room."""
    return [thing for thing in truth.evaluated() if not is_layout(thing.class_name)]


def overlaps_of(truth: TrueRoom, predicted: PredictedMap) -> dict[tuple[int, int], float]:
    """Return the IoU of (true instance, entity) over the points of the truth."""
    labels = label_true_points(truth, predicted, OPTIONS.label_distance)
    return point_overlaps(truth, labels, predicted.classes())


def partners(truth: TrueRoom, overlaps: Mapping[tuple[int, int], float], classes: Mapping[int, str]) -> dict[int, int]:
    """Return true thing -> the entity that is it, by instance.

    overlaps: as in `overlaps_of`; classes: of the entities.
    """
    wanted = {thing.instance for thing in true_things(truth)}
    return {
        true: entity
        for (true, entity), iou in sorted(overlaps.items(), key=lambda pair: pair[1])
        if iou >= ONE_PIECE and true in wanted and not is_layout(classes[entity])
    }


def false_things(truth: TrueRoom, predicted: PredictedMap, found: Iterable[int]) -> list[int]:
    """Return the entities that are no true thing, by instance: things, none of the `found`, with most of their surface
    where the truth says what is there, and not most of that on a thing that counts neither way."""
    owner = nearest_labels(
        predicted.surface.vertices, truth.points, truth.instances, maximum_distance=OPTIONS.label_distance
    )
    known, false = set(found), []
    for instance, name in predicted.classes().items():
        own = owner[predicted.vertex_instances == instance]
        told = own[own != 0]
        if instance in known or is_layout(name) or not len(own) or 2 * len(told) < len(own):
            continue
        values, counts = np.unique(told, return_counts=True)
        if int(values[counts.argmax()]) not in truth.optional:
            false.append(instance)
    return false


def tallied(
    things: Iterable[TrueObject],
    found: Mapping[int, int],
    classes: Mapping[int, str],
    off: Mapping[int, float],
    limit: float,
    unknown: frozenset[int] = frozenset(),
) -> Tally:
    """Count things. off: true instance -> how far its stand-in is off [m], of which `limit` still stands where it
    stood; `unknown`: things whose class is no class of ours, which cannot be named right."""
    things = list(things)
    here = [thing for thing in things if thing.instance in found]
    named = [
        thing
        for thing in here
        if thing.class_name != UNNAMED
        and thing.instance not in unknown
        and classes[found[thing.instance]] == thing.class_name
    ]
    gaps = [off[thing.instance] for thing in here if thing.instance in off]
    stand = sum(gap <= limit for gap in gaps)
    return Tally(len(things), len(here), len(named), stand, tuple(round(1000 * gap, 1) for gap in gaps))


def judged(
    truth: TrueRoom,
    predicted: PredictedMap | None,
    found: Mapping[int, int],
    off: Mapping[int, float],
    limit: float,
    unknown: frozenset[int] = frozenset(),
) -> Things:
    """Put the counts of a room together; `found` and `off` by true instance, the others as in `tallied`."""
    things = true_things(truth)
    classes = {} if predicted is None else predicted.classes()
    sizes = [[thing for thing in things if is_large(thing) is large] for large in (True, False)]
    large, small = (tallied(each, found, classes, off, limit, unknown) for each in sizes)
    false = [] if predicted is None else false_things(truth, predicted, found.values())
    return Things(large, small, len(false))


def middles_off(truth: TrueRoom, found: Mapping[int, int], scene: CadScene) -> dict[int, float]:
    """Return true instance -> distance between the middles of its box and of its stand-in's [m]."""
    boxes = {node.instance: node.box for node in scene.graph.nodes if node.box is not None}
    true = truth.by_instance()
    return {
        k: float(np.linalg.norm(np.subtract(boxes[entity].center, true[k].box.center)))
        for k, entity in found.items()
        if entity in boxes
    }


def surfaces_off(truth: TrueRoom, found: Mapping[int, int], scene: CadScene) -> dict[int, float]:
    """Return true instance -> median distance of its points that were seen to the surface of its stand-in [m].

    For truth whose boxes are rough, and hold of a thing what was seen: a model is whole where of a chair the back alone
    was seen, so that the middles of the two say nothing.
    """
    nodes = {node.instance: node.id for node in scene.graph.nodes}
    off = {}
    for k, entity in found.items():
        surface = surface_of(scene, nodes[entity]) if entity in nodes else None
        if surface is not None:
            off[k] = float(np.median(cKDTree(surface).query(truth.points[truth.instances == k])[0]))
    return off


def surface_of(scene: CadScene, node: str) -> np.ndarray | None:
    """Return points (N, 3) [m] on what stands for a node: its model, or the mesh that it keeps; None for layout.

    Raises BadInput when a file of the scene is broken.
    """
    entry = next((each for each in scene.info.replacements if each.node == node), None)
    if entry is None or entry.decision == "layout":
        return None
    if entry.decision == "mesh" or entry.chosen is None:
        return np.asarray(read_mesh(scene.path(f"meshes/{node}.ply")).vertices, float)
    chosen = entry.chosen
    folder = scene.path(f"models/{chosen.model_id}")
    mesh = posed_mesh(folder, read_model(folder), chosen.joints, chosen.scale)
    points = mesh.sample(SAMPLES, seed=0)
    return apply(np.array(chosen.world_from_model), np.asarray(points, float))
