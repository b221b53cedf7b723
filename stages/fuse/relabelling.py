"""Entities and labels of a surface after its vertices were given to other instances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scenewright.stages.fuse.extraction import ExtractedEntity, LabelledSurface
from scenewright.stages.fuse.surface import Surface
from scenewright.stages.kit.formats.map_files import cut_mesh, face_labels
from scenewright.stages.kit.formats.ply_files import ColoredMesh


def relabelled(
    surface: Surface,
    entities: Sequence[ExtractedEntity],
    labelled: LabelledSurface,
    instance: np.ndarray,
    new_classes: Mapping[int, int],
) -> tuple[list[ExtractedEntity], LabelledSurface]:
    """Return entities and labels where every vertex is of `instance` (V,), 0 none; those without a face are gone.

    `new_classes`: class of each instance that is no entity yet. Nobody voted for these: they have no segments.
    """
    of_face = face_labels(instance, surface.faces)
    order = np.argsort(of_face, kind="stable")
    ordered = of_face[order]
    moved = instance != labelled.instance
    changed = set(np.union1d(instance[moved], labelled.instance[moved]).tolist())

    def mesh_of(number: int) -> ColoredMesh:
        start, end = np.searchsorted(ordered, (number, number + 1))
        return cut_mesh(surface, order[start:end])

    cut = [replace(e, mesh=mesh_of(e.instance)) if e.instance in changed else e for e in entities]
    cut += [ExtractedEntity(k, c, (), mesh_of(k), 0.0, 0) for k, c in sorted(new_classes.items())]
    kept = [entity for entity in cut if len(entity.mesh.faces)]
    class_of = np.zeros(int(instance.max(initial=0)) + 1, np.int32)
    present = np.zeros(len(class_of), bool)
    for entity in kept:
        class_of[entity.instance], present[entity.instance] = entity.class_id, True
    last = np.where(present[instance], instance, 0).astype(np.int32)
    return kept, LabelledSurface(labelled.segment, np.where(last > 0, class_of[last], 0).astype(np.int32), last)
