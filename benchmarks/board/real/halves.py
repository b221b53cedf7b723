"""Two scenes of one log, of its even and of its odd frames: whatever is true, they must agree.

Beside it stands what they explain of the surface that was seen, since finding nothing repeats perfectly.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import SCENE_NODE
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.schemas.vocabulary import UNNAMED
from scenewright.stages.evaluate import PredictedMap, load_map, nearest_labels
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.measurement.panoptic_quality import overlaps
from scenewright.stages.truth import seen_points

from benchmarks.board.method import Method
from benchmarks.board.real.chain import Run, run_chain
from benchmarks.board.real.logs import Log
from benchmarks.board.real.records import Half, HalvesRecord
from benchmarks.board.real.things import is_layout
from benchmarks.graph_scores import OPTIONS

EVERY = 3
"""Every how many-th frame of a half shows the surface that is to be explained."""
FARTHEST = 4.0
"""Farther depth shows none [m]."""
ONE_THING = 0.5
"""Intersection over union from which on two things are one."""


@dataclass(frozen=True)
class Thing:
    """A thing of one scene."""

    instance: int
    class_name: str
    middle: tuple[float, float, float]
    """Of its box [m]."""
    parent: int | str
    """Instance of the thing that carries it; the class of what bounds the room; `scene`."""
    relation: str
    model: str
    """Of the library; empty where it kept its mesh."""


@dataclass(frozen=True)
class Scene:
    """One half, as it is compared."""

    things: tuple[Thing, ...]
    vertices: np.ndarray
    """(V, 3) of the map [m]."""
    owner: np.ndarray
    """(V,) thing of each, by instance; 0 where it is none."""


def measure_halves(method: Method, log: Log, scratch: Path, masks: tuple[str, ...] = ()) -> HalvesRecord:
    """Run the chain on both halves of a log below `scratch`, up to `cad`, and compare. masks: options of `segment`."""
    library = scratch / "cad_library"
    runs = [run_chain(method, half, scratch / half.name, library, masks, last="cad") for half in log.halves()]
    commands = dict.fromkeys(name for run in runs for name in run.seconds)
    seconds = {name: round(sum(run.seconds.get(name, 0.0) for run in runs), 2) for name in commands}
    halves = [half_of(run) for run in runs]
    failed = next((run.failed for run in runs if run.failed), "")
    scenes = [scene_of(run) for run in runs]
    first, second = scenes
    compared = HalvesRecord(log.name)
    if first is not None and second is not None:
        compared = agreement(log.name, first, in_world_of(runs[0], runs[1], second))
    return replace(compared, even=halves[0], odd=halves[1], seconds=seconds, failed=failed)


def scene_of(run: Run) -> Scene | None:
    """Return the things of a half; None where the chain did not get so far."""
    made, scene = run.made(PanopticMap), run.made(CadScene)
    if made is None or scene is None:
        return None
    predicted = load_map(made)
    things = things_of(scene)
    owner = np.where(np.isin(predicted.vertex_instances, [t.instance for t in things]), predicted.vertex_instances, 0)
    return Scene(things, np.asarray(predicted.surface.vertices, float), owner)


def things_of(scene: CadScene) -> tuple[Thing, ...]:
    """Return the things of a CAD scene: its nodes that have a box and do not bound the room."""
    graph = scene.graph
    nodes = {node.id: node for node in graph.nodes}
    models = {each.node: each.chosen.library_model for each in scene.info.replacements if each.chosen is not None}
    things = []
    for node in graph.nodes:
        if node.id == SCENE_NODE or node.box is None or is_layout(node.class_name):
            continue
        link = graph.parent_link(node.id)
        above = None if link is None else nodes[link.source]
        parent: int | str = SCENE_NODE
        if above is not None and above.id != SCENE_NODE:
            parent = above.class_name if is_layout(above.class_name) else above.instance
        relation = "" if link is None else link.relation
        model = models.get(node.id, "")
        things.append(Thing(node.instance, node.class_name, node.box.center, parent, relation, model))
    return tuple(things)


def in_world_of(first: Run, second: Run, scene: Scene) -> Scene:
    """Return the scene of the second run in the world of the first: `ingest` made each upright by its own frames."""
    worlds = []
    for run in (first, second):
        sequence = run.made(SequenceArtifact)
        assert sequence is not None, "a scene has a sequence"
        worlds.append(np.array(sequence.info.gravity.world_from_log))
    motion = worlds[0] @ inverse(worlds[1])
    things = tuple(replace(thing, middle=as_vector(apply(motion, np.array(thing.middle)))) for thing in scene.things)
    return Scene(things, apply(motion, scene.vertices), scene.owner)


def matches(first: Scene, second: Scene) -> dict[int, int]:
    """Return thing of the first -> thing of the second, by instance: those whose surfaces are the same for half of
    both together, over the vertices of both maps. No thing is matched twice."""
    reach = OPTIONS.label_distance
    theirs = nearest_labels(first.vertices, second.vertices, second.owner, reach)
    ours = nearest_labels(second.vertices, first.vertices, first.owner, reach)
    shared = overlaps(np.concatenate([first.owner, ours]), np.concatenate([theirs, second.owner]))
    rows: dict[int, int] = {}
    columns: dict[int, int] = {}
    for (a, b), count in shared.items():
        rows[a], columns[b] = rows.get(a, 0) + count, columns.get(b, 0) + count
    return {a: b for (a, b), count in shared.items() if a and b and count > ONE_THING * (rows[a] + columns[b] - count)}


def agreement(log: str, first: Scene, second: Scene) -> HalvesRecord:
    """Count what two scenes in one world agree in."""
    pairs = matches(first, second)
    one, other = ({thing.instance: thing for thing in scene.things} for scene in (first, second))
    both = [(one[a], other[b]) for a, b in sorted(pairs.items())]
    named = [(a, b) for a, b in both if {a.class_name, b.class_name} != {UNNAMED}]
    modelled = [(a, b) for a, b in both if a.model or b.model]
    return HalvesRecord(
        log,
        matched=len(both),
        apart_m=tuple(round(float(np.linalg.norm(np.subtract(a.middle, b.middle))), 4) for a, b in both),
        same_parent=sum(same_parent(a, b, pairs) for a, b in both),
        with_name=len(named),
        same_class=sum(a.class_name == b.class_name for a, b in named),
        with_model=len(modelled),
        same_model=sum(a.model == b.model for a, b in modelled),
    )


def same_parent(first: Thing, second: Thing, pairs: Mapping[int, int]) -> bool:
    """Whether two matched things hang on the same, in the same relation."""
    parent = pairs.get(first.parent) if isinstance(first.parent, int) else first.parent
    return parent is not None and parent == second.parent and first.relation == second.relation


def half_of(run: Run) -> Half:
    """Count what was seen of a half and what its map explains of it."""
    sequence, made, scene = run.made(SequenceArtifact), run.made(PanopticMap), run.made(CadScene)
    if sequence is None:
        return Half()
    points, _ = seen_points(sequence, every=EVERY, maximum_depth=FARTHEST, with_labels=False)
    things, layout = (0, 0) if made is None else explained(points, load_map(made))
    return Half(
        frames=sequence.info.frame_count,
        things=0 if scene is None else len(things_of(scene)),
        surface=len(points),
        by_things=things,
        by_layout=layout,
    )


def explained(points: np.ndarray, predicted: PredictedMap) -> tuple[int, int]:
    """Return how many of the points (N, 3) lie on things of the map, and on what bounds the room."""
    labels = nearest_labels(
        points, predicted.surface.vertices, predicted.vertex_instances, maximum_distance=OPTIONS.label_distance
    )
    layout = [instance for instance, name in predicted.classes().items() if is_layout(name)]
    on_layout = np.isin(labels, layout)
    return int(((labels != 0) & ~on_layout).sum()), int(on_layout.sum())
