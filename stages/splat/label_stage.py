"""The step `splat label`: what pictures show of every entity of a panoptic map, so that open words find it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.errors import BadInput
from scenewright.schemas.language_map import LanguageMap, LanguageMapFile, LanguageRegion
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.kit.formats.entity_meshes import load_entity_mesh
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.boxes import minimum_box
from scenewright.stages.kit.geometry.point_clouds import middle_of
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.open_words.opening import open_encoder
from scenewright.stages.kit.open_words.reading.evidence import colors_of, names_of_map
from scenewright.stages.kit.open_words.vectors import of_regions, write_vectors
from scenewright.stages.kit.stage import Context
from scenewright.stages.splat.language.looks import looks, sight_of
from scenewright.stages.splat.parameters import LabelParameters
from scenewright.stages.splat.views import evenly, posed_frames


def run(
    panoptic_map: PanopticMap,
    sequence: Sequence,
    trajectory: Trajectory | None,
    weights: Path | None,
    *,
    parameters: LabelParameters,
    context: Context,
) -> LanguageMap:
    """Look at every entity where pictures show it best. The outcome is `empty` for a map without entities.

    Raises BadInput for a sequence without colour, depth or poses.
    """
    encoder = open_encoder(parameters, weights, context.device)
    entities = [entity for entity in panoptic_map.info.entities if entity.vertices]
    loaded = [load_entity_mesh(panoptic_map.path(entity.mesh)) for entity in entities]
    meshes, names = [mesh.vertices for mesh in loaded], names_of_map(panoptic_map)
    sights = []
    with FrameReader(sequence.path("frames.mcap")) as reader:
        if "depth" not in reader.streams:
            raise BadInput(f"{sequence.root}: its frames have no depth, which says what is hidden", hint="record depth")
        posed = posed_frames(reader, sequence, trajectory)
        frames = evenly([frame for frame, _ in posed], parameters.most_views) if entities else []
        poses = dict(posed)
        for frame in context.progress.track(frames, total=len(frames), description="images"):
            frame_read = reader.read(frame, ("color", "depth"))
            if frame_read.color is not None and frame_read.depth is not None:
                sights.append(sight_of(reader, frame_read, frame_read.depth, inverse(poses[frame])))
    with context.progress.step("look"):
        vectors, counts = looks(meshes, sights, encoder)
        boxes = [minimum_box(np.asarray(points)) for points in meshes]
    write_vectors(context.output, of_regions(vectors))
    info = LanguageMapFile(
        source="panoptic_map",
        encoder=encoder.label,
        width=encoder.width,
        sizes=(),
        gaussians=0,
        steps=0,
        loss=0.0,
        regions=tuple(
            LanguageRegion(
                instance=entity.instance,
                class_name=entity.class_name,
                box=box,
                point=as_vector(middle_of(np.asarray(mesh.vertices, float))),
                looks=int(count),
                names=dict(names[entity.instance].shares),
                seen=names[entity.instance].looks,
                said=names[entity.instance].said,
                colors=colors_of(mesh.colors),
            )
            for entity, box, mesh, count in zip(entities, boxes, loaded, counts, strict=True)
        ),
    )
    info.write(context.output / "language.json")
    summary = {"entities": len(entities), "seen": int(np.count_nonzero(counts)), "pictures": len(sights)}
    return LanguageMap(context.output, outcome="ok" if entities else "empty", summary=summary)
