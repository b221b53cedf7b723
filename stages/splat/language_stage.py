"""The step `splat language`: what pictures say, kept in a splat."""

from __future__ import annotations

from collections import deque
from pathlib import Path

import numpy as np
import torch
from scenewright.schemas.errors import BadInput
from scenewright.schemas.language_map import LanguageMap, LanguageMapFile, LanguageRegion
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.scene_parts import Box
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.splat import Splat
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.entity_meshes import load_entity_mesh
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.boxes import minimum_box
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.open_words.answering import members_of
from scenewright.stages.kit.open_words.opening import open_encoder
from scenewright.stages.kit.open_words.reading.evidence import colors_of, names_of_map
from scenewright.stages.kit.open_words.vectors import Vectors, write_vectors
from scenewright.stages.kit.rendering.splatting.rasterizer import View
from scenewright.stages.kit.stage import Context
from scenewright.stages.splat.build_stage import rasterizer_of
from scenewright.stages.splat.language.entities import NONE, entity_of, nearest_entities
from scenewright.stages.splat.language.field import LanguageField
from scenewright.stages.splat.language.learning import learn, lesson_of
from scenewright.stages.splat.language.looks import looks, sight_of
from scenewright.stages.splat.language.pieces import pieces
from scenewright.stages.splat.language.pyramid import pyramid
from scenewright.stages.splat.parameters import LanguageParameters
from scenewright.stages.splat.ply import read_gaussians
from scenewright.stages.splat.strays import no_strays
from scenewright.stages.splat.views import evenly, posed_frames

SIZES = tuple(round(float(size), 4) for size in np.geomspace(0.08, 1.5, 8))
"""Sizes at which every Gaussian is asked for, up to the thesis's largest [m]."""
LAST = 50
"""Last steps whose mean loss is kept; by eye."""
COVERED = 0.5
"""Opacity from which on a pixel counts as covered."""


def run(
    splat: Splat,
    sequence: Sequence,
    panoptic_map: PanopticMap | None,
    weights: Path | None,
    *,
    parameters: LanguageParameters,
    context: Context,
) -> LanguageMap:
    """Learn a language field over a splat, and keep what pictures show of each of its pieces; of a panoptic map of the
    same place, which entity each belongs to.

    The outcome is `empty` for a splat without Gaussians. Raises BadInput for another sequence.
    """
    encoder = open_encoder(parameters, weights, context.device)
    gaussians, rasterizer = read_gaussians(splat.path("splat.ply")), rasterizer_of(context.device)
    frames = [view.frame for view in splat.built.views if view.use == "learned"]
    lessons, sights = [], []
    with FrameReader(sequence.path("frames.mcap")) as reader:
        poses = dict(posed_frames(reader, sequence, splat))
        chosen = evenly(frames, parameters.most_views) if len(gaussians) else []
        for frame in context.progress.track(chosen, total=len(chosen), description="images"):
            if frame not in poses:
                raise BadInput(
                    f"{sequence.root}: frame {frame} is not there: the splat was built from another sequence",
                    hint="give that sequence",
                )
            frame_read = reader.read(frame, ("color", "depth"))
            if frame_read.color is None:
                continue
            camera, pose = reader.cameras[frame_read.camera_name], inverse(poses[frame])
            lessons.append(lesson_of(pyramid(frame_read.color, encoder), gaussians, rasterizer, camera, pose))
            depth = frame_read.depth
            if depth is None:
                drawn = rasterizer.draw(gaussians, View(camera, pose)).picture
                depth = np.where(drawn.alpha > COVERED, drawn.depth / np.maximum(drawn.alpha, 1e-6), 0).astype(
                    np.float32
                )
            sights.append(sight_of(reader, frame_read, depth, pose))
    field, losses = _field(gaussians.means, encoder.width, context.seed), deque[float](maxlen=LAST)
    if any(len(lesson.places) for lesson in lessons):
        taught = learn(field, lessons, parameters.steps, context.random(1))
        losses.extend(context.progress.track(taught, total=parameters.steps, description="steps"))
    with context.progress.step("pieces"):
        numbered = _number_rows(pieces(gaussians))
        order, starts = members_of(numbered, int(numbered.max(initial=-1)) + 1)
        members_of_region = np.split(order, starts[1:-1]) if len(order) else []
        members = [gaussians.means[part].astype(float) for part in members_of_region]
        vectors, counts = looks(members, sights, encoder)
    regions = [
        LanguageRegion(box=minimum_box(points[no_strays(points)]), looks=int(count))
        for points, count in zip(members, counts, strict=True)
    ]
    if panoptic_map is not None:
        regions = _name_regions(regions, members_of_region, gaussians.means, panoptic_map)
    at_sizes = [field.vectors(gaussians.means, size) for size in SIZES]
    opacities = 1.0 / (1.0 + np.exp(-gaussians.logit_opacities))
    every = np.stack(at_sizes, axis=1) if len(gaussians) else np.zeros((0, len(SIZES), encoder.width), np.float32)
    write_vectors(context.output, Vectors(vectors, gaussians.means, opacities, numbered, every))
    info = LanguageMapFile(
        source="splat",
        encoder=encoder.label,
        width=encoder.width,
        sizes=SIZES,
        gaussians=len(gaussians),
        steps=parameters.steps if losses else 0,
        loss=float(np.mean(losses)) if losses else 0.0,
        regions=tuple(regions),
    )
    info.write(context.output / "language.json")
    summary = {
        "gaussians": len(gaussians),
        "regions": len(members),
        **({"named": sum(bool(region.instance) for region in regions)} if panoptic_map is not None else {}),
        "pictures": len(lessons),
        "loss": round(info.loss, 4),
    }
    return LanguageMap(context.output, outcome="ok" if members else "empty", summary=summary)


def _name_regions(
    regions: list[LanguageRegion], parts: list[np.ndarray], means: np.ndarray, panoptic_map: PanopticMap
) -> list[LanguageRegion]:
    """Return regions with the entities that their Gaussians (`parts`) belong to: instance, class and, of a thing, its
    box; walls and floors have pieces, which have boxes of their own."""
    entities = [entity for entity in panoptic_map.info.entities if entity.vertices]
    meshes = [load_entity_mesh(panoptic_map.path(entity.mesh)) for entity in entities]
    surfaces, names = [np.asarray(mesh.vertices) for mesh in meshes], names_of_map(panoptic_map)
    colors = [colors_of(mesh.colors) for mesh in meshes]
    owners, classes, boxes = nearest_entities(means, surfaces), load_vocabulary(), dict[int, Box]()
    named_regions = []
    for region, part in zip(regions, parts, strict=True):
        number = entity_of(owners[part])
        if number == NONE:
            named_regions.append(region)
            continue
        entity = entities[number]
        own = names[entity.instance]
        fields: dict[str, object] = {
            "instance": entity.instance,
            "class_name": entity.class_name,
            "names": dict(own.shares),
            "seen": own.looks,
            "said": own.said,
            "colors": colors[number],
        }
        if not classes.by_name(entity.class_name).is_layout:
            fields["box"] = boxes.setdefault(number, minimum_box(surfaces[number]))
        named_regions.append(region.model_copy(update=fields))
    return named_regions


def _field(means: np.ndarray, width: int, seed: int) -> LanguageField:
    torch.manual_seed(seed)
    return LanguageField(means if len(means) else np.zeros((1, 3)), width)


def _number_rows(found: np.ndarray) -> np.ndarray:
    """Return pieces (granularities, N) with numbers of their own in every row."""
    result, first = found.copy(), 0
    for row in result:
        row[row >= 0] += first
        first = max(first, int(row.max(initial=-1)) + 1)
    return result
