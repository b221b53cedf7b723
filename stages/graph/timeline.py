"""How the contact graph grew while the map did: graphs of partial maps, with ids that last."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scenewright.schemas.contact_graph import (
    SCENE_NODE,
    Beside,
    ContactGraphFile,
    GraphChanges,
    GraphNode,
    GraphSnapshot,
    Reattached,
    TimelineFile,
)
from scenewright.schemas.scene_parts import TREE_RELATIONS, Relation
from scenewright.stages.graph.nodes import Entity
from scenewright.stages.graph.tracks import Tracks


@dataclass(frozen=True)
class Stand:
    """The graph of one partial map, after so many frames."""

    frames: int
    graph: ContactGraphFile
    entities: list[Entity]


def build_timeline(stands: list[Stand]) -> TimelineFile:
    """Follow every node through the graphs, earliest first, and say what changed from each to the next."""
    tracks = Tracks()
    followed = [tracks.follow(stand.entities) for stand in stands]
    names = lasting_ids([{track: name for name, track in step.of_node.items()} for step in followed])
    snapshots: list[GraphSnapshot] = []
    for stand, step in zip(stands, followed, strict=True):
        renaming = {SCENE_NODE: SCENE_NODE, **{name: names[track] for name, track in step.of_node.items()}}
        nodes = tuple(
            node.model_copy(update={"id": renaming[node.id], "planes": (), "mesh": None}) for node in stand.graph.nodes
        )
        links = tuple(
            link.model_copy(update={"source": renaming[link.source], "target": renaming[link.target]})
            for link in stand.graph.links
        )
        merged = {names[gone]: names[into] for gone, into in step.merged.items()}
        before = snapshots[-1] if snapshots else None
        changes = changes_between(before, nodes, links, merged)
        snapshots.append(GraphSnapshot(frames=stand.frames, nodes=nodes, links=links, changes=changes))
    return TimelineFile(snapshots=tuple(snapshots))


def lasting_ids(snapshots: list[dict[int, str]]) -> dict[int, str]:
    """Return the lasting id of every track: its name in the last of the snapshots ({track: name}) that has it.

    Of two tracks with one name the one that lived longer has it, the other gets a number behind it.
    """
    last: dict[int, str] = {}
    for snapshot in snapshots:
        for track, name in snapshot.items():
            last.pop(track, None)
            last[track] = name  # in the order in which they were seen last
    ids: dict[int, str] = {}
    uses: dict[str, int] = {}
    for track, name in reversed(last.items()):
        uses[name] = uses.get(name, 0) + 1
        ids[track] = name if uses[name] == 1 else f"{name}.{uses[name]}"
    return ids


def changes_between(
    before: GraphSnapshot | None, nodes: tuple[GraphNode, ...], links: tuple[Relation, ...], merged: Mapping[str, str]
) -> GraphChanges:
    """Return what is different from the snapshot before (None: everything appeared)."""
    old_nodes = {node.id: node for node in before.nodes} if before else {}
    old_links = before.links if before else ()
    new_nodes = {node.id: node for node in nodes}
    old_parents, new_parents = _parents(old_links), _parents(links)
    reattached = [
        Reattached(
            node=name,
            parent=new_parents[name][0],
            relation=new_parents[name][1],
            before_parent=old_parents[name][0],
            before_relation=old_parents[name][1],
        )
        for name in sorted(new_parents.keys() & old_parents.keys())
        if new_parents[name] != old_parents[name]
    ]
    old_beside, new_beside = _beside(old_links), _beside(links)
    return GraphChanges(
        appeared=tuple(sorted(new_nodes.keys() - old_nodes.keys() - {SCENE_NODE})),
        vanished=tuple(sorted(old_nodes.keys() - new_nodes.keys() - merged.keys())),
        merged=dict(sorted(merged.items())),
        renamed={
            name: old_nodes[name].class_name
            for name in sorted(new_nodes.keys() & old_nodes.keys())
            if old_nodes[name].class_name != new_nodes[name].class_name
        },
        reattached=tuple(reattached),
        added=tuple(Beside(source=s, target=t, relation=r) for s, t, r in sorted(new_beside - old_beside)),
        removed=tuple(Beside(source=s, target=t, relation=r) for s, t, r in sorted(old_beside - new_beside)),
    )


def _parents(links: tuple[Relation, ...]) -> dict[str, tuple[str, str]]:
    return {link.target: (link.source, link.relation) for link in links if link.relation in TREE_RELATIONS}


def _beside(links: tuple[Relation, ...]) -> set[tuple[str, str, str]]:
    """Relations beside the tree; the ends of undirected ones in alphabetical order."""
    shared: set[tuple[str, str, str]] = set()
    for link in links:
        if link.relation not in TREE_RELATIONS:
            source, target = link.source, link.target
            if link.relation == "proximal" and target < source:
                source, target = target, source
            shared.add((source, target, link.relation))
    return shared
