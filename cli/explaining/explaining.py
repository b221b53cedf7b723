"""The reasons of an artifact and of all that it was made from, by name."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from scenewright.cli.explaining.cad_reasons import cad_reasons
from scenewright.cli.explaining.graph_reasons import graph_reasons
from scenewright.cli.explaining.map_reasons import map_reasons
from scenewright.cli.explaining.plan_reasons import plan_reasons
from scenewright.cli.explaining.reason import Reason, Reasons
from scenewright.cli.explaining.scene_reasons import scene_reasons
from scenewright.cli.viewing.desk.generations import behind
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph, GraphNode
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.plan import Plan

EXPLAINED: tuple[tuple[type[Artifact], Callable[[Any], Reasons]], ...] = (
    (PanopticMap, map_reasons),
    (ContactGraph, graph_reasons),
    (CadScene, cad_reasons),
    (InteractiveScene, scene_reasons),
    (Plan, plan_reasons),
)
"""In the order in which they are made."""
NEAREST = 5
"""Names that are offered in place of one that is not known."""


@dataclass(frozen=True)
class Source:
    """What one artifact records."""

    artifact: Artifact
    reasons: Reasons


@dataclass(frozen=True)
class Explained:
    """What an artifact and its inputs record, the first made first."""

    artifact: Artifact
    sources: tuple[Source, ...]
    missing: tuple[str, ...]
    """Inputs that record reasons and are not at hand, a sentence each."""

    def names(self) -> list[str]:
        """Return what can be asked for, each name once, in the order in which it came up."""
        return list(dict.fromkeys(name for source in self.sources for name in source.reasons))

    def of(self, name: str) -> list[tuple[Artifact, list[Reason]]]:
        """Return the reasons of a name by artifact. Raises UsageError for an unknown name."""
        found = [(source.artifact, source.reasons[name]) for source in self.sources if name in source.reasons]
        if not found:
            names = self.names()
            near = get_close_matches(name, names, n=NEAREST, cutoff=0.5)
            hint = (
                f"the nearest: {', '.join(near)}"
                if near
                else f"scenewright explain {self.artifact.root} lists its names"
            )
            raise UsageError(f"{self.artifact.root}: has no {name!r:.80}", hint=hint)
        return found


def explain(artifact: Artifact) -> Explained:
    """Read the reasons of an artifact and of its inputs, as far as they are there still.

    Raises BadInput for a kind that records none, and for a payload of the artifact itself that cannot be read.
    """
    kinds = [kind for kind, _ in EXPLAINED]
    if not isinstance(artifact, tuple(kinds)):
        raise BadInput(
            f"{artifact.root}: a {artifact.kind!r} artifact records no reasons",
            hint=f"give one of {', '.join(kind.kind for kind in kinds)}",
        )
    sources: list[Source] = []
    missing: list[str] = []
    for kind, reasons_of in EXPLAINED:
        nearest = next(behind(artifact, kind), None)
        if nearest is None:
            continue
        try:
            sources.append(Source(nearest, reasons_of(nearest)))
        except BadInput as error:
            if nearest is artifact:
                raise
            missing.append(str(error))
    _name_as_later(sources)
    return Explained(artifact, tuple(sources), (*missing, *_gone(sources)))


def sentences(artifact: Artifact) -> dict[str, list[str]]:
    """Return by name what is said of it, for a page; nothing where the artifact, or its kind, says nothing."""
    try:
        explained = explain(artifact)
    except BadInput:
        return {}
    return {
        name: [reason.says for source in explained.sources for reason in source.reasons.get(name, ())]
        for name in explained.names()
    }


def _name_as_later(sources: list[Source]) -> None:
    """Give the reasons of a map's entities the names, too, that graphs and scenes have for them after an edit."""
    maps = [source for source in sources if isinstance(source.artifact, PanopticMap)]
    for source in maps:
        assert isinstance(source.artifact, PanopticMap)
        first = {entity.instance: f"{entity.class_name}_{entity.instance}" for entity in source.artifact.info.entities}
        for node in (node for later in sources for node in _nodes(later.artifact) if node.instance in first):
            source.reasons.setdefault(node.id, source.reasons[first[node.instance]])


def _nodes(artifact: Artifact) -> tuple[GraphNode, ...]:
    if isinstance(artifact, ContactGraph):
        return artifact.info.nodes
    return artifact.graph.nodes if isinstance(artifact, CadScene | InteractiveScene) else ()


def _gone(sources: list[Source]) -> Iterator[str]:
    """Yield which inputs that record reasons are not at hand."""
    there = {source.artifact.kind for source in sources}
    explained = {kind.kind for kind, _ in EXPLAINED}
    for source in sources:
        for record in () if source.artifact.manifest is None else source.artifact.manifest.inputs:
            if record.kind in explained - there:
                place = os.path.normpath(source.artifact.root / record.path)
                yield f"{place}: the {record.kind} is not there, or was made anew: what it records is left out"
