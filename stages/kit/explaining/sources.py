"""The reasons that artifacts of one chain record, by name: what `scenewright explain`, pages and reports say."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from scenewright.schemas.artifact import Artifact
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraph, GraphNode
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.plan import Plan
from scenewright.stages.kit.explaining.cad_reasons import cad_reasons
from scenewright.stages.kit.explaining.graph_reasons import graph_reasons
from scenewright.stages.kit.explaining.map_reasons import map_reasons
from scenewright.stages.kit.explaining.plan_reasons import plan_reasons
from scenewright.stages.kit.explaining.reason import Reasons
from scenewright.stages.kit.explaining.scene_reasons import scene_reasons

EXPLAINED: tuple[tuple[type[Artifact], Callable[[Any], Reasons]], ...] = (
    (PanopticMap, map_reasons),
    (ContactGraph, graph_reasons),
    (CadScene, cad_reasons),
    (InteractiveScene, scene_reasons),
    (Plan, plan_reasons),
)
"""In the order in which they are made."""


@dataclass(frozen=True)
class Source:
    """What one artifact records."""

    artifact: Artifact
    reasons: Reasons


def sources_of(artifacts: Iterable[Artifact]) -> list[Source]:
    """Return what artifacts record, those made first before the others; other kinds record nothing.

    Raises BadInput for a payload that cannot be read.
    """
    given = list(artifacts)
    rows = [Source(one, reasons_of(one)) for kind, reasons_of in EXPLAINED for one in given if isinstance(one, kind)]
    name_as_later(rows)
    return rows


def name_as_later(sources: Sequence[Source]) -> None:
    """Give the reasons of a map's entities the names, too, that graphs and scenes have for them after an edit."""
    for source in sources:
        if isinstance(source.artifact, PanopticMap):
            first = _entities(source.artifact)
            for node in (node for later in sources for node in _nodes(later.artifact) if node.instance in first):
                source.reasons.setdefault(node.id, source.reasons[first[node.instance]])


def sentences(sources: Sequence[Source]) -> dict[str, list[str]]:
    """Return by name what is said of it, in the order in which the names came up."""
    names = dict.fromkeys(name for source in sources for name in source.reasons)
    return {name: [reason.says for source in sources for reason in source.reasons.get(name, ())] for name in names}


def entity_names(sources: Sequence[Source]) -> list[str]:
    """Return the names of what is mapped: nodes of graphs and scenes, then entities that became none."""
    nodes = {node.id: node.instance for source in sources for node in _nodes(source.artifact)}
    entities: dict[int, str] = {}
    for source in sources:
        if isinstance(source.artifact, PanopticMap):
            entities |= _entities(source.artifact)
    known = set(nodes.values())
    return [name for name in nodes if name != SCENE_NODE] + [n for k, n in entities.items() if k not in known]


def _entities(panoptic_map: PanopticMap) -> dict[int, str]:
    return {entity.instance: f"{entity.class_name}_{entity.instance}" for entity in panoptic_map.info.entities}


def _nodes(artifact: Artifact) -> tuple[GraphNode, ...]:
    if isinstance(artifact, ContactGraph):
        return artifact.info.nodes
    return artifact.graph.nodes if isinstance(artifact, CadScene | InteractiveScene) else ()
