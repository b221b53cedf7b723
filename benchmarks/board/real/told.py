"""A log against a truth that somebody measured: what of it is found, named, and stands where it stood."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph, ContactGraphFile
from scenewright.schemas.errors import BadInput
from scenewright.schemas.ground_truth import TrueObject
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.scene_parts import CARRYING, Box
from scenewright.schemas.sequence import Sequence
from scenewright.stages.evaluate import TrueRoom, load_map
from scenewright.stages.evaluate.surfaces import Surface
from scenewright.stages.kit.geometry.boxes import gravity_aligned_box, minimum_box
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.labels import class_of_word
from scenewright.stages.kit.measurement.pose_error import yaw_of
from scenewright.stages.truth import most_common_labels, seen_points
from scipy.spatial import cKDTree

from benchmarks.board.method import Method
from benchmarks.board.real.annotated import NO_GRAPH, own_sequence
from benchmarks.board.real.chain import Run, run_chain
from benchmarks.board.real.records import Edges, Things, TruthRecord
from benchmarks.board.real.things import false_things, is_layout, judged, middles_off, overlaps_of, partners
from benchmarks.board.real.truth_folder import Bounds, Instance, Told, is_unknown, read_truth

NEAR = 0.1
"""A stand-in is where its thing stood when their middles are at most so far apart [m]."""
SEEN_WITHIN = 0.05
"""A true point was seen where depth shows surface at most so far from it [m]."""
LEAST_SEEN = 0.2
"""A thing counts from this share of its points on that were seen."""
FRAMES = 60
"""About so many frames, evenly over the log, say what was seen."""
FARTHEST = 4.0
"""Farther depth says nothing [m]."""
NO_THING = -1
"""Owner of points of which is known that they are of no thing."""


@dataclass(frozen=True)
class ToldRoom:
    """A truth in the world of a sequence."""

    truth: TrueRoom
    supports: Mapping[int, int | Bounds]
    """True instance that was seen -> what carries it."""
    unknown: frozenset[int]
    """Instances whose word is no class."""


def measure_truth(method: Method, folder: Path, scratch: Path, masks: tuple[str, ...] = ()) -> TruthRecord:
    """Run the chain of the log of a folder below `scratch` and judge what it made. masks: options of `segment`.

    Raises BadInput when the folder does not hold what it should, or the log shows nothing of the truth.
    """
    told = read_truth(folder)
    folder, library = scratch / told.log.name, scratch / "cad_library"
    run = run_chain(method, told.log, folder, library, masks, last="ingest")
    sequence = run.made(Sequence) or own_sequence(told.log, folder)
    if "pose" not in sequence.info.streams:
        raise BadInput(f"{told.log.path}: has no poses, so that nobody knows where the truth is", hint="add them")
    room = room_of(told, sequence)
    run = run if run.failed else run_chain(method, told.log, folder, library, masks)
    things, supports = judge_told(room, run)
    return TruthRecord(
        told.log.name,
        things,
        supports,
        unseen=len(room.truth.optional),
        unknown_words=told.unknown_words,
        frames=sequence.info.frame_count,
        seconds=run.seconds,
        failed=run.failed,
    )


def room_of(told: Told, sequence: Sequence) -> ToldRoom:
    """Return a truth in the world of a sequence, its points thinned to one a centimetre, those that were not seen left
    out. Raises BadInput when the log shows none of it."""
    world_from_log = np.array(sequence.info.gravity.world_from_log)
    numbers = np.array([0, *(entry.id for entry in told.file.instances)])
    order = np.argsort(numbers)
    number_of = order[np.searchsorted(numbers[order], told.owner)]
    points, number = most_common_labels(apply(world_from_log, told.points), number_of)
    surface, _ = seen_points(
        sequence, every=max(1, sequence.info.frame_count // FRAMES), maximum_depth=FARTHEST, with_labels=False
    )
    seen = np.isfinite(cKDTree(surface).query(points, distance_upper_bound=SEEN_WITHIN)[0])
    if not (seen & (number > 0)).any():
        hint = "give the truth in metres, in the world of the log's poses"
        raise BadInput(f"{told.log.path}: shows nothing within {100 * SEEN_WITHIN:g} cm of the truth", hint=hint)
    shares = seen_shares(number, seen, len(numbers))
    objects = tuple(
        object_of(entry, points[number == k], world_from_log) for k, entry in enumerate(told.file.instances, 1)
    )
    hidden = {entry.id for k, entry in enumerate(told.file.instances, 1) if shares[k] < LEAST_SEEN}
    owner = numbers[number[seen]]
    truth = TrueRoom(
        objects=objects,
        points=points[seen],
        instances=np.where(owner == 0, NO_THING, owner) if told.file.complete else owner,
        graph=NO_GRAPH,
        surface=Surface(np.zeros((0, 3)), np.zeros((0, 3), np.int64)),
        optional=frozenset(hidden),
        name=told.log.name,
    )
    return ToldRoom(
        truth, supports_told(told, truth), frozenset(e.id for e in told.file.instances if is_unknown(e.word))
    )


def seen_shares(number: np.ndarray, seen: np.ndarray, count: int) -> np.ndarray:
    """Return (count,) the share of the points of each number 0 .. count - 1 that were seen, 0 where it has none.

    number (N,), seen (N,) bool.
    """
    return np.bincount(number[seen], minlength=count) / np.maximum(np.bincount(number, minlength=count), 1)


def object_of(entry: Instance, points: np.ndarray, world_from_log: np.ndarray) -> TrueObject:
    """Return a thing with its box in the world: the one that is given, else the one around its points (N, 3)."""
    class_name = class_of_word(entry.word)
    return TrueObject(
        instance=entry.id,
        name=f"{class_name}_{entry.id}",
        class_name=class_name,
        world_from_model=as_transform(np.eye(4)),
        box=box_of(entry, points, world_from_log),
        visible_pixels=len(points),
    )


def box_of(entry: Instance, points: np.ndarray, world_from_log: np.ndarray) -> Box:
    """Return the box of a thing; a dot in the origin where it has neither box nor points, which counts neither way."""
    if entry.box is not None:
        yaw = np.radians(entry.box.yaw_degrees) + yaw_of(world_from_log[:3, :3])
        return gravity_aligned_box(apply(world_from_log, np.array(entry.box.center)), entry.box.size, yaw)
    return minimum_box(points if len(points) else np.zeros((1, 3)))


def supports_told(told: Told, truth: TrueRoom) -> dict[int, int | Bounds]:
    """Return thing that was seen -> what carries it, where that is known. What bounds the room goes by its class."""
    objects = truth.by_instance()
    supports: dict[int, int | Bounds] = {}
    for entry in told.file.instances:
        if entry.support is None or entry.id in truth.optional or is_layout(objects[entry.id].class_name):
            continue
        above = objects[entry.support] if isinstance(entry.support, int) else None
        bounds = above is not None and above.class_name in ("floor", "wall", "ceiling")
        supports[entry.id] = above.class_name if above is not None and bounds else entry.support  # type: ignore[assignment]
    return supports


def judge_told(room: ToldRoom, run: Run) -> tuple[Things, Edges]:
    """Hold what the chain made against the truth; what it did not make is missed."""
    truth, made, graph, scene = room.truth, run.made(PanopticMap), run.made(ContactGraph), run.made(CadScene)
    predicted = None if made is None else load_map(made)
    found = {} if predicted is None else partners(truth, overlaps_of(truth, predicted), predicted.classes())
    off = {} if scene is None else middles_off(truth, found, scene)
    things = judged(truth, predicted, found, off, NEAR, room.unknown)
    false = [] if predicted is None else false_things(truth, predicted, found.values())
    return things, supports_agreed(room.supports, found, NO_GRAPH if graph is None else graph.info, false)


def supports_agreed(
    told: Mapping[int, int | Bounds], found: Mapping[int, int], graph: ContactGraphFile, false: Iterable[int]
) -> Edges:
    """Count supports whatever their relation is called: true ones that are known, and predicted ones of the things
    that they are known of and of the `false` ones. found: true instance -> entity."""
    nodes = {node.instance: node for node in graph.nodes if node.instance}
    parents = {link.target: graph.node(link.source) for link in graph.links if link.relation in CARRYING}
    predicted = {k: parents.get(nodes[found[k]].id) for k in told if k in found and found[k] in nodes}
    agreed = 0
    for k, above in predicted.items():
        wanted = told[k]
        if above is not None:
            agreed += above.instance == found.get(wanted) if isinstance(wanted, int) else above.class_name == wanted
    extra = sum(nodes[entity].id in parents for entity in false if entity in nodes) if told else 0
    return Edges(len(told), sum(above is not None for above in predicted.values()) + extra, agreed)
