"""Putting a whole room right at the desk: a script that knows the truth edits a map, its graph and its scene, as the
page does, until the scene settles with the right supports, and counts what that took."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.cli.viewing.desk.desk import Desk
from scenewright.schemas.cad_scene import SURROUNDINGS, CadScene
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraph, ContactGraphFile
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.scene_parts import Box
from scenewright.schemas.vocabulary import UNNAMED, load_vocabulary
from scenewright.stages.edit import MapState, written_box
from scenewright.stages.edit.graph_edits import and_below
from scenewright.stages.kit.geometry.boxes import box_yaw, gravity_aligned_box, points_in_box
from scenewright.stages.kit.simulation.engine import engine
from scenewright.stages.kit.simulation.world import load_scene
from scenewright.stages.urdf import COLLISION_DEPTH, resting_overlaps

from benchmarks.experiments.edits.making import WIDER
from benchmarks.steps import opened, step

MENTAL, POINT_AND_CLICK, KEY = 1.35, 1.3, 0.28
"""Seconds of the keystroke-level model (Card, Moran and Newell 1980): to decide, to point and click, to type a
letter."""
MOST = 0.5
"""A thing of the map is the true one that so much of its surface belongs to; a true thing in another is split off when
the other has so much of its surface."""
SPURIOUS = 0.8
"""A thing is none when so much of its surface belongs to nothing."""
FEWEST = 40
"""Vertices of a part that is worth an edit."""
ROUNDS = 4
"""How often physics is asked."""
CLEARANCE = 0.002
"""What is pushed out of something comes to lie so far from it [m]."""


@dataclass(frozen=True)
class TrueNode:
    """A thing as it is in truth."""

    name: str
    class_name: str
    box: Box
    wanted: bool
    """Whether it has to be in the scene: it was seen, and is no part of the building."""


@dataclass(frozen=True)
class Told:
    """What the script knows."""

    nodes: Mapping[int, TrueNode]
    owner: np.ndarray
    """(V,) which of them each vertex of the map belongs to, 0 none."""
    parent: Mapping[str, tuple[str, str]]
    """Name -> what carries it, and how."""
    as_good: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Name -> what carries it as well, or may: such a support is not wrong."""


@dataclass
class Work:
    """What it took."""

    edits: Counter[str] = field(default_factory=Counter)
    refused: int = 0
    """Edits that came to a conflict and were taken back."""
    clicks: int = 0
    seconds: float = 0.0
    """By the keystroke-level model."""

    def count(self, what: str, asked: Mapping[str, Any]) -> None:
        """Count an edit: its button, a click for each thing, two for each box, a word typed or chosen, and writing."""
        things = sum(len(one) if isinstance(one, list) else 1 for key, one in asked.items() if key in ("of", "on"))
        boxes = sum(key in ("box", "part") for key in asked)
        words = [str(one) for key, one in asked.items() if key in ("class", "model")]
        clicks = 2 + things + 2 * boxes + len(words) + sum(key in ("as", "surface") for key in asked)
        self.edits[what] += 1
        self.clicks += clicks
        self.seconds += MENTAL * (1 + things + boxes) + POINT_AND_CLICK * clicks + KEY * sum(map(len, words))


class Editor:
    """Somebody at the desk of an artifact."""

    def __init__(self, path: Path, file: Path, work: Work) -> None:
        self.desk, self._work = Desk(path, file), work

    @property
    def state(self) -> Any:
        """What is edited, as it is now."""
        return self.desk.subjects[0].state

    def ask(self, what: str, **asked: Any) -> bool:
        """Ask for an edit as the page does; take it back when it comes to a conflict. Return whether it holds."""
        now = self.desk.now()
        at = {"artifact": now["artifact"], "revision": now["revision"]}
        told = self.desk.append({"what": what, **asked}, **at, by="script", note="")
        self._work.count(what, asked)
        row = told["rows"][-1]
        if row["status"] == "conflict":
            self.desk.remove(row["number"], artifact=told["artifact"], revision=told["revision"])
            self._work.refused += 1
        return bool(row["status"] != "conflict")


def owners(state: MapState, told: Told) -> dict[int, Counter[int]]:
    """Return thing -> true thing (0: none) -> vertices. What was drawn is of none."""
    owner = np.concatenate([told.owner, np.zeros(len(state.instance) - len(told.owner), told.owner.dtype)])
    found: dict[int, Counter[int]] = {}
    span = int(owner.max(initial=0)) + 1
    pairs, counts = np.unique(state.instance.astype(np.int64) * span + owner, return_counts=True)
    for pair, count in zip(pairs.tolist(), counts.tolist(), strict=True):
        found.setdefault(pair // span, Counter())[pair % span] = count
    return found


def put_map_right(editor: Editor, told: Told) -> dict[str, int]:
    """Split what holds several things, join what is in parts, name, add and delete. Return true name -> instance."""
    for _ in range(2):  # what was split off may hold another one
        seen = owners(editor.state, told)
        for thing in editor.state.things():
            counts = seen[thing.instance]
            main = max(counts, key=lambda k: counts[k])
            for k, count in counts.items():
                node = told.nodes.get(k)
                if node is None or not node.wanted or count < FEWEST:
                    continue
                if k == main and count >= MOST * counts.total():
                    continue
                if count >= MOST * int((told.owner == k).sum()):
                    editor.ask("split", of=thing.name, part=_around(node.box), **{"class": node.class_name})
    parts: dict[int, list[str]] = {}
    seen = owners(editor.state, told)
    for thing in sorted(editor.state.things(), key=lambda thing: -(thing.surface.n if thing.surface else 0)):
        counts = seen[thing.instance]
        main, most = counts.most_common(1)[0]
        if main and most >= MOST * counts.total():
            parts.setdefault(main, []).append(thing.name)
        elif counts[0] >= SPURIOUS * counts.total() and load_vocabulary().by_name(thing.class_name).movable:
            editor.ask("delete", of=thing.name)
        elif thing.class_name not in {UNNAMED, *(told.nodes[k].class_name for k in counts if k)}:
            editor.ask("rename", of=thing.name, **{"class": UNNAMED})
    for k, node in told.nodes.items():
        names = parts.get(k, [])
        if len(names) > 1:
            editor.ask("merge", of=names)
        if names and not names[0].startswith(f"{node.class_name}_"):
            editor.ask("rename", of=names[0], **{"class": node.class_name})
        if not names and node.wanted:
            state = editor.state
            bare = points_in_box(node.box, state.surface.vertices) & (state.instance == 0)
            surface = "seen" if bare.sum() >= FEWEST else "box"
            editor.ask("add", box=_around(node.box), surface=surface, **{"class": node.class_name})
    found = _named(editor.state, told)
    for thing in editor.state.things():  # what was drawn is where its box is
        for node in told.nodes.values():
            if node.name not in found and np.allclose(thing.box.center, node.box.center, atol=2 * WIDER):
                found[node.name] = thing.instance
    return found


def _around(box: Box) -> dict[str, Any]:
    return written_box(gravity_aligned_box(box.center, np.asarray(box.size) + 2 * WIDER, box_yaw(box))).model_dump()


def supports_right(graph: ContactGraphFile, found: Mapping[str, int], told: Told) -> tuple[list[str], int]:
    """Return the things that stand on the wrong thing, or are missing, and how many things there are."""
    wrong, total = [], 0
    ids = {node.instance: node.id for node in graph.nodes}
    for node in told.nodes.values():
        if not node.wanted or node.name not in told.parent:
            continue
        total += 1
        parent, _ = told.parent[node.name]
        mine = ids.get(found.get(node.name, -1))
        link = graph.parent_link(mine) if mine is not None else None
        carriers = (parent, *told.as_good.get(node.name, ()))
        wanted = {SCENE_NODE if name == SCENE_NODE else ids.get(found.get(name, -1)) for name in carriers}
        if link is None or link.source not in wanted:
            wrong.append(node.name)
    return wrong, total


def put_graph_right(editor: Editor, found: Mapping[str, int], told: Told) -> None:
    """Pin the supports that are wrong."""
    for name in supports_right(editor.state.graph, found, told)[0]:
        ids = {node.instance: node.id for node in editor.state.graph.nodes}
        parent, relation = told.parent[name]
        mine, carrier = ids.get(found.get(name, -1)), ids.get(found.get(parent, -1))
        if mine is not None and carrier is not None and editor.state.graph.node(mine).node_type != "layout":
            editor.ask("support", of=mine, on=carrier, relation=relation)


def put_scene_right(editor: Editor, scene: InteractiveScene) -> bool:
    """Hold what physics moves, and push out of each other what lies in each other; whether anything was done."""
    settling = scene.settling
    assert settling is not None
    moved = [body.name for body in settling.bodies if body.leaves is not None or body.fell_through]
    asked = [editor.ask("mark", of=name, **{"as": "fixed"}) for name in dict.fromkeys(moved)]
    pushed: set[str] = set()
    for name, way in ways_out(scene):
        node = next((node for node in editor.state.graph.nodes if node.id == name), None)
        if node is None or node.box is None or name in pushed:
            continue
        pushed |= and_below(editor.state.graph, name)
        to = (np.asarray(node.box.center) + way).tolist()
        asked.append(editor.ask("move", of=name, to=to, carried=True))
    return any(asked)


def ways_out(scene: InteractiveScene) -> list[tuple[str, np.ndarray]]:
    """Return which bodies lie in others and how each gets out (3,) [m], the deepest first: the smaller one of two
    moves, parts of the building and what nobody named do not."""
    ways = []
    vocabulary = load_vocabulary()
    with load_scene(scene.root) as world:
        for pair in resting_overlaps(world, COLLISION_DEPTH):
            one, other = world.bodies[pair.first], world.bodies[pair.second]
            points = engine.getClosestPoints(one.body_id, other.body_id, 0.0, physicsClientId=world.client)
            deepest = min(points, key=lambda point: point[8])
            out = np.asarray(deepest[7]) * (CLEARANCE - deepest[8])  # the way of `one`: the normal points to it
            loose = [
                (float(np.prod(np.subtract(*world.bounds(body.name)[::-1]))), body.name, way)
                for body, way in ((one, out), (other, -out))
                if not vocabulary.by_name(body.record.class_name).is_layout and body.name != SURROUNDINGS
            ]
            ways += [(name, way) for _, name, way in sorted(loose, key=lambda entry: entry[:2])[:1]]
    return ways


def chain(folder: Path, panoptic_map: Path, library: Path, graph: Path | None = None) -> tuple[Path, Path, Path]:
    """Return graph, CAD scene and interactive scene of a map, made where they are not."""
    graph = graph or step("graph", folder / "graph", panoptic_map=panoptic_map)
    cad = step("cad", folder / "cad", contact_graph=graph, panoptic_map=panoptic_map, library=library)
    return graph, cad, step("urdf", folder / "urdf", cad_scene=cad)


def put_room_right(folder: Path, panoptic_map: Path, library: Path, told: Told) -> dict[str, float]:
    """Edit a room until its scene settles with the right supports, or physics was asked ROUNDS times."""
    file, work = folder / "edits.toml", Work()
    file.unlink(missing_ok=True)
    editor = Editor(panoptic_map, file, work)
    as_it_is = _named(editor.state, told)
    graph, _, scene = chain(folder / "before", panoptic_map, library)
    wrong, total = supports_right(opened(ContactGraph, graph).info, as_it_is, told)
    before = opened(InteractiveScene, scene)
    figures = {
        "things": float(total),
        "wrong_before": float(len(wrong)),
        "settles_before": float(before.outcome == "ok"),
    }
    found = put_map_right(editor, told)
    edited_map = step("edit map", folder / "map", panoptic_map=panoptic_map, edits=file)
    graph = step("graph", folder / "graph", panoptic_map=edited_map)
    put_graph_right(Editor(graph, file, work), found, told)
    graph = step("edit graph", folder / "edited_graph", contact_graph=graph, edits=file)
    wrong, _ = supports_right(opened(ContactGraph, graph).info, found, told)
    _, cad, scene = chain(folder / "after", edited_map, library, graph)
    for number in range(ROUNDS):
        after = opened(InteractiveScene, scene)
        if after.outcome == "ok" or not put_scene_right(Editor(cad, file, work), after):
            break
        edited = step("edit scene", folder / f"scene_{number}", cad_scene=cad, edits=file)
        scene = step("urdf", folder / f"urdf_{number}", cad_scene=edited)
    after = opened(InteractiveScene, scene)
    held = sum(node.mark == "fixed" for node in after.graph.nodes)
    return figures | {
        "wrong_after": float(len(wrong)),
        "settles_after": float(after.outcome == "ok"),
        "edits": float(work.edits.total()),
        **{f"edits_{what}": float(count) for what, count in sorted(work.edits.items())},
        "taken_back": float(work.refused),
        "clicks": float(work.clicks),
        "minutes": work.seconds / 60.0,
        "held": float(held),
        "free_before": float(sum(body.movable for body in before.info.bodies)),
        "free_after": float(sum(body.movable for body in after.info.bodies)),
        "models_after": float(sum(entry.decision == "cad" for entry in opened(CadScene, cad).info.replacements)),
    }


def _named(state: MapState, told: Told) -> dict[str, int]:
    """Return true name -> the thing of the map that is it; of a part of the building, the one that has most of it, as a
    map may have all walls in one."""
    found: dict[str, int] = {}
    for instance, counts in owners(state, told).items():
        main, most = counts.most_common(1)[0]
        if instance and main and most >= MOST * counts.total():
            found.setdefault(told.nodes[main].name, instance)
    for k, node in told.nodes.items():
        if node.name not in found and is_layout(node.class_name):
            held = state.instance[: len(told.owner)][told.owner == k]
            if held.any():
                found[node.name] = int(np.bincount(held[held > 0]).argmax())
    return found


def is_layout(class_name: str) -> bool:
    """Whether things of a class are parts of the building."""
    return load_vocabulary().by_name(class_name).node == "layout"
