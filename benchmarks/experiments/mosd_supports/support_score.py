"""Who rests on whom: the parents of a contact graph against an annotation that names several carriers, and doubts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.stages.truth import SupportAnnotation

SECOND = ("second", "also_supports", "leans_on")


@dataclass
class SupportScore:
    """Counts of edges child to parent. `to_things` leaves the edges to the table out."""

    true: int = 0
    predicted: int = 0
    agreed: int = 0
    true_to_things: int = 0
    predicted_to_things: int = 0
    agreed_to_things: int = 0
    doubtful: int = 0
    """Children whose predicted parent is one that the annotator could not rule out: they count neither way."""
    second: dict[str, list[int]] = field(default_factory=lambda: {name: [0, 0, 0] for name in SECOND})
    """Contacts beside the parent -> true, predicted, agreed; `second` takes both kinds together."""
    levels: dict[int, list[int]] = field(default_factory=dict)
    """Level of the child (1 on the table) -> children, children whose parent is right."""
    wrong: list[tuple[str, str, str, str]] = field(default_factory=list)
    """(scene, child, true carriers, predicted parent) of everything that disagrees."""

    def add(self, other: SupportScore) -> None:
        """Add the counts of other frames."""
        for name in (
            "true",
            "predicted",
            "agreed",
            "true_to_things",
            "predicted_to_things",
            "agreed_to_things",
            "doubtful",
        ):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        for relation, counts in other.second.items():
            self.second[relation] = [a + b for a, b in zip(self.second[relation], counts, strict=True)]
        for level, counts in other.levels.items():
            own = self.levels.setdefault(level, [0, 0])
            self.levels[level] = [a + b for a, b in zip(own, counts, strict=True)]
        self.wrong += other.wrong


def f1(true: int, predicted: int, agreed: int) -> float:
    """Harmonic mean of precision and recall; 1 when there is neither a true nor a predicted edge."""
    return 2.0 * agreed / (true + predicted) if true + predicted else 1.0


def levels_of(told: SupportAnnotation, base: str) -> dict[str, int]:
    """Return how many things are between each child and the base, plus one: 1 for what stands on `base` alone."""
    carriers = {relation.child: relation.carriers() for relation in told.relations if relation.child != base}

    def level(name: str) -> int:
        return 1 + max((level(carrier) for carrier in carriers[name] if carrier in carriers), default=0)

    return {name: level(name) for name in carriers}


def parent_name(graph: ContactGraphFile, node: str) -> str:
    """Name of a parent that stands for no annotated node."""
    link = graph.parent_link(node)
    return f"({link.source if link is not None else 'nothing'})"


def score_graph(
    told: SupportAnnotation, graph: ContactGraphFile, node_of: Mapping[int, str], base: str
) -> SupportScore:
    """Compare the parents in `graph` with those of the annotation.

    node_of: instance of a node of the graph -> name of the annotated node that it is; base: the annotated node (the
    table) that everything stands on. A predicted parent agrees when it is any of the carriers; one that is named under
    `uncertain` takes the child out of the count. Where no node of the graph is the base, layout and the scene stand for
    it, as masks of objects alone leave the table out. Children that no annotated node matches count as predicted edges.
    """
    names = {node.id: node_of.get(node.instance, "") for node in graph.nodes}
    if base not in names.values():
        names |= {node.id: base for node in graph.nodes if node.node_type in ("scene", "layout")}
    is_thing = {node.id for node in graph.nodes if node.node_type not in ("scene", "layout") and names[node.id] != base}
    parent: dict[str, str] = {}
    score = SupportScore()
    for identity in sorted(is_thing):
        link = graph.parent_link(identity)
        above = names[link.source] if link is not None else ""
        if names[identity]:
            parent[names[identity]] = above or parent_name(graph, identity)
        else:
            score.predicted += 1
            score.predicted_to_things += above != base
            score.wrong.append((told.scene, f"not annotated ({identity})", "", above or parent_name(graph, identity)))
    optional = {node.name for node in told.nodes if node.optional}
    levels = levels_of(told, base)
    beside = {
        (link.relation, names[link.source], names[link.target])
        for link in graph.links
        if link.relation in score.second and names[link.target] and link.target in is_thing
    }
    for relation in told.relations:
        child = relation.child
        if child == base or child in optional:
            continue
        carriers, found = relation.carriers(), parent.get(child)
        if found in relation.uncertain:
            score.doubtful += 1
            continue
        right = found in carriers
        to_thing = base not in carriers or (right and found != base)
        score.true += 1
        score.true_to_things += to_thing
        score.agreed += right
        score.agreed_to_things += right and found != base
        if found is not None:
            score.predicted += 1
            score.predicted_to_things += found != base
        own = score.levels.setdefault(levels[child], [0, 0])
        score.levels[levels[child]] = [own[0] + 1, own[1] + right]
        if not right:
            score.wrong.append((told.scene, child, " + ".join(carriers), found or "not in the map"))
        others = set(carriers) - {found} if right else set(relation.also)
        wanted = {"also_supports": others, "leans_on": set(relation.leans_on)}
        got = {
            kind: {source for name, source, target in beside if (name, target) == (kind, child)}
            - set(relation.uncertain)
            for kind in wanted
        }
        wanted["second"], got["second"] = set().union(*wanted.values()), set().union(*got.values())
        for kind, counts in score.second.items():
            both = wanted[kind] & got[kind]
            score.second[kind] = [counts[0] + len(wanted[kind]), counts[1] + len(got[kind]), counts[2] + len(both)]
    return score
