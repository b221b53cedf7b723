"""Relations beside the tree: further carriers, and what keeps an object from falling over (Han 2024, section 2.6.5)."""

from __future__ import annotations

from scenewright.schemas.scene_parts import Relation
from scenewright.stages.graph.balance import leaning_relation
from scenewright.stages.graph.evidence import on_surface, with_leaning_contact
from scenewright.stages.graph.nodes import Entity
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.graph.shared_support import PartialSupport, partial_supports, together_with
from scenewright.stages.graph.support import Candidate
from scenewright.stages.graph.tree import descends_from

FULLY_CARRIED = 0.9
"""Share of a thing's footprint from which on a carrier needs no help."""


def relations_beside(
    entities: list[Entity], chosen: dict[str, Candidate], parameters: GraphParameters
) -> list[Relation]:
    """Return `also_supports` and `leans_on` of all objects, in the order of the entities."""
    relations: list[Relation] = []
    by_name = {entity.name: entity for entity in entities}
    for child in entities:
        candidate = chosen.get(child.name)
        if candidate is None or candidate.relation != "supports":
            continue
        relations += further_carriers(child, candidate, entities, chosen, parameters)
        leaning = leaning_relation(child, candidate.parent, entities)
        if leaning is not None and not descends_from(leaning.source, child.name, chosen):
            relations.append(with_leaning_contact(leaning, child, by_name[leaning.source]))
    return relations


def further_carriers(
    child: Entity,
    candidate: Candidate,
    entities: list[Entity],
    chosen: dict[str, Candidate],
    parameters: GraphParameters,
) -> list[Relation]:
    """Return `also_supports` of every other entity that carries a part of the child at the height of its parent."""
    if candidate.patch is None or candidate.overlap >= FULLY_CARRIED:
        return []
    by_name = {entity.name: entity for entity in entities}
    main = PartialSupport(candidate.parent, candidate.patch, candidate.gap, candidate.overlap, candidate.height)
    return [
        Relation(
            source=part.parent,
            target=child.name,
            relation="also_supports",
            confidence=float(part.share),
            plane=part.patch,
            gap=float(part.gap),
            overlap=float(part.share),
            contact=on_surface(child.box, by_name[part.parent].patches[part.patch].hull, part.height),
        )
        for part in together_with(main, partial_supports(child, entities, parameters))
        if not descends_from(part.parent, child.name, chosen)
    ]
