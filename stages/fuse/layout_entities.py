"""Floor, walls and ceiling as entities of the map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scenewright.schemas.vocabulary import Vocabulary
from scenewright.stages.fuse.extraction import ExtractedEntity, LabelledSurface
from scenewright.stages.fuse.layout.room import Layout
from scenewright.stages.fuse.surface import Surface
from scenewright.stages.kit.formats.map_files import cut_mesh, face_labels

SURE = 0.5


def with_layout(
    surface: Surface,
    entities: Sequence[ExtractedEntity],
    labelled: LabelledSurface,
    layout: Layout,
    told: np.ndarray,
    things: frozenset[int],
    vocabulary: Vocabulary,
) -> tuple[list[ExtractedEntity], LabelledSurface]:
    keeps = np.isin(labelled.class_id, sorted(things)) & (told >= SURE)
    instance, class_id = labelled.instance.copy(), labelled.class_id.copy()
    first = 1 + int(instance.max(initial=0))
    new = []
    for number, kind in enumerate(("floor", "wall", "ceiling")):
        of_kind = layout.of(kind) & ~keeps & ((labelled.class_id == 0) | np.isin(labelled.class_id, sorted(things)))
        if of_kind.any():
            instance[of_kind], class_id[of_kind] = first + number, vocabulary.by_name(kind).id
            new.append(ExtractedEntity(first + number, vocabulary.by_name(kind).id, (), cut_mesh(surface, np.zeros(0, int)), 1.0, 0))
    of_face = face_labels(instance, surface.faces)
    cut = [replace(e, mesh=cut_mesh(surface, np.flatnonzero(of_face == e.instance))) for e in (*entities, *new)]
    kept = [e for e in cut if len(e.mesh.faces)]
    lost = ~np.isin(instance, [e.instance for e in kept])
    return kept, LabelledSurface(labelled.segment, np.where(lost, 0, class_id).astype(np.int32), np.where(lost, 0, instance).astype(np.int32))
