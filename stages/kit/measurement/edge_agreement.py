"""Precision, recall and F1 of the directed edges of a contact graph, by relation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.scene_parts import CARRYING

DIRECTED = CARRYING
"""Edges of the tree that claim a support: an `unknown` one counts neither as predicted nor as true."""
Edge = tuple[str, str, str]
"""Source, target, relation."""
BESIDE_THE_TREE = ("also_supports", "leans_on", "proximal")
UNJUDGED = ("proximal", "unknown")


@dataclass(frozen=True)
class EdgeAgreement:
    """Counts of one relation."""

    true_count: int
    predicted_count: int
    agreed: int

    @property
    def precision(self) -> float | None:
        """Share of the predicted edges that are true; None without any."""
        return self.agreed / self.predicted_count if self.predicted_count else None

    @property
    def recall(self) -> float | None:
        """Share of the true edges that were predicted; None without any."""
        return self.agreed / self.true_count if self.true_count else None

    @property
    def f1(self) -> float | None:
        """Harmonic mean; None when there is neither a true nor a predicted edge."""
        total = self.true_count + self.predicted_count
        return 2.0 * self.agreed / total if total else None


def edge_agreement(
    true: ContactGraphFile,
    predicted: ContactGraphFile,
    partner: Mapping[str, str],
    *,
    ignored: frozenset[str] = frozenset(),
    relations: tuple[str, ...] = (*DIRECTED, *BESIDE_THE_TREE),
) -> dict[str, EdgeAgreement]:
    """Compare edges under a pairing of nodes.

    `partner`: true node id -> predicted node id (the scene roots pair by themselves). An edge agrees when both ends
    are partners and the relation is the same (proximal edges have no direction). True edges that touch an
    `ignored` true node (never seen by the camera), and predicted edges that touch its partner, do not count. Returns
    each relation's counts; as `any_support` those of all directed edges whatever their relation is called; and as
    `support` those of the directed edges of the tree, relation and all, without the edges that hang floor, walls and
    ceiling on the scene, which cannot be wrong.
    """
    names = _with_roots(true, predicted, partner)
    skipped = {names[name] for name in ignored if name in names}
    result: dict[str, EdgeAgreement] = {}
    for relation in relations:
        result[relation] = _agreement(true, predicted, names, ignored, skipped, (relation,))
    result["any_support"] = _agreement(true, predicted, names, ignored, skipped, DIRECTED)
    below = [
        _agreement(_below_root(true), _below_root(predicted), names, ignored, skipped, (relation,))
        for relation in DIRECTED
    ]
    result["support"] = EdgeAgreement(
        sum(a.true_count for a in below), sum(a.predicted_count for a in below), sum(a.agreed for a in below)
    )
    return result


def edge_errors(
    true: ContactGraphFile,
    predicted: ContactGraphFile,
    partner: Mapping[str, str],
    *,
    ignored: frozenset[str] = frozenset(),
) -> tuple[frozenset[Edge], frozenset[Edge]]:
    """Return the true edges that were not found and the predicted edges that are not true, but for those that are
    proximal and those that claim nothing (`unknown`).

    `partner`, `ignored` as in `edge_agreement`.
    """
    names = _with_roots(true, predicted, partner)
    skipped = {names[name] for name in ignored if name in names}
    true_edges = {(k.source, k.target, k.relation) for k in true.links if not {k.source, k.target} & ignored}
    got = {(k.source, k.target, k.relation) for k in predicted.links if not {k.source, k.target} & skipped}
    matched = {(s, t, r): (names.get(s, ""), names.get(t, ""), r) for s, t, r in true_edges}
    missing = {edge for edge, matched_edge in matched.items() if matched_edge not in got}
    wrong = got - set(matched.values())
    return (
        frozenset(edge for edge in missing if edge[2] not in UNJUDGED),
        frozenset(edge for edge in wrong if edge[2] not in UNJUDGED),
    )


def _with_roots(true: ContactGraphFile, predicted: ContactGraphFile, partner: Mapping[str, str]) -> dict[str, str]:
    """`partner` and the pair of scene roots."""
    names = dict(partner)
    for node in true.nodes:
        if node.node_type == "scene":
            names[node.id] = next((n.id for n in predicted.nodes if n.node_type == "scene"), node.id)
    return names


def _below_root(graph: ContactGraphFile) -> ContactGraphFile:
    """The graph without the edges of floor, walls and ceiling to the scene."""
    roots = {node.id for node in graph.nodes if node.node_type == "scene"}
    layout = {node.id for node in graph.nodes if node.node_type == "layout"}
    links = tuple(link for link in graph.links if not (link.source in roots and link.target in layout))
    return graph.model_copy(update={"links": links})


def _agreement(
    true: ContactGraphFile,
    predicted: ContactGraphFile,
    names: Mapping[str, str],
    ignored: frozenset[str],
    skipped: set[str],
    relations: tuple[str, ...],
) -> EdgeAgreement:
    def key(source: str, target: str) -> tuple[str, str]:
        return (source, target) if relations != ("proximal",) else (min(source, target), max(source, target))

    true_pairs = [
        (link.source, link.target)
        for link in true.links
        if link.relation in relations and not {link.source, link.target} & ignored
    ]
    got = {
        key(link.source, link.target)
        for link in predicted.links
        if link.relation in relations and not {link.source, link.target} & skipped
    }
    agreed = {key(names[s], names[t]) for s, t in true_pairs if s in names and t in names} & got
    return EdgeAgreement(len(set(true_pairs)), len(got), len(agreed))
