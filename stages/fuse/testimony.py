"""The name that each entity gets from what all looks said of it.

Ours. Each decision leaves its reason with the entity (schemas/panoptic_map.py, `Because`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.vocabulary import UNNAMED, Vocabulary
from scenewright.stages.fuse.extraction import ExtractedEntity, LabelledSurface
from scenewright.stages.fuse.names import Naming, Said, name_of, networks_of, rates_of
from scenewright.stages.kit.class_extents import extent_of

BY_MASKS = "masks"
GROWN = "masks, and the piece of which they have a part"
PIECE = "a piece that geometry cuts"
JOINED = "parts that masks take for one"
FOOTED = "what floated, and the narrow thing below it"
BOUND = "planes that bound the room"
BY_MOST_LOOKS = "masks of the class, in most looks"
"""How the surface of an entity was found."""
NOTHING = Said(0.0, {})


@dataclass(frozen=True)
class Reason:
    """Why an entity is what it is."""

    shape: str
    said: Said
    naming: Naming | None
    """None of what bounds the room, and of other surface that is no thing."""


def with_names(
    entities: Sequence[ExtractedEntity],
    labelled: LabelledSurface,
    shapes: Mapping[int, str],
    said: Mapping[int, Said],
    vocabulary: Vocabulary,
    things: frozenset[int],
) -> tuple[list[ExtractedEntity], LabelledSurface, dict[int, Reason]]:
    """Return entities and labels with names, and the reasons by instance. `said`: by instance what looks said."""
    unnamed = vocabulary.by_name(UNNAMED).id
    names = things - {unnamed}
    of_things = [said.get(e.instance, NOTHING) for e in entities if e.class_id in things]
    networks = networks_of(of_things, names)
    usual = rates_of([told for told in of_things if names & set(told.scores)], names).right
    result, reasons, class_id = [], {}, labelled.class_id.copy()
    for entity in entities:
        naming, shape = None, shapes.get(entity.instance, BY_MASKS)
        told = said.get(entity.instance, NOTHING)
        if entity.class_id in things:
            naming = name_of(told, usual, networks, extent_of(np.asarray(entity.mesh.vertices)), vocabulary, unnamed)
            class_id[labelled.instance == entity.instance] = naming.class_id
            entity = replace(entity, class_id=naming.class_id)
        elif entity.instance not in shapes:
            shape = BY_MOST_LOOKS
        reasons[entity.instance] = Reason(shape, told, naming)
        result.append(entity)
    return result, replace(labelled, class_id=class_id), reasons
