"""How wrong vision is, as measured on rendered tables, for simulators that do not render.

The file is written by `python -m benchmarks.tidy.detect_errors` from a run on tuning seeds; it says which.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from pydantic import Field
from scenewright.schemas.base import Model
from scenewright.schemas.places import data_file
from scenewright.stages.tableware.vision.detections import Detection
from scenewright.stages.tableware.world.items import TABLE_SIDES, UTENSILS, Kind, Table

FILE = data_file("tableware/error_model.json")


class KindErrors(Model):
    """Of one kind."""

    items: int
    """That were to be seen."""
    position_sigma: float
    """Standard deviation of the place along each axis [m] of those found."""
    yaw_sigma: float = 0.0
    """Of a utensil's direction [rad], turned heads left out."""
    turned_rate: float = Field(default=0.0, ge=0.0, le=1.0)
    """Share whose head and handle were taken for each other."""
    miss_rate: float = Field(ge=0.0, le=1.0)
    """Share of items of which nothing was said."""
    confused_as: dict[Kind, float] = {}
    """Share of items that were taken for another kind."""
    false_rate: float = Field(ge=0.0)
    """Detections an image of this kind where no item is."""


class ErrorModel(Model):
    """error_model.json."""

    date: str
    commit: str
    command: str
    seeds: str
    """`tuning` or `reporting`."""
    images: int
    conditions: str
    kinds: dict[Kind, KindErrors]
    unknown_rate: float
    """Things of unknown kind an image where there are none."""


@cache
def error_model() -> ErrorModel:
    """Return the committed model. Raises BadInput for a damaged file."""
    return ErrorModel.read(FILE, hint="python -m benchmarks.tidy.detect_errors writes it")


def sampled_detections(
    table: Table, random: np.random.Generator, model: ErrorModel | None = None
) -> tuple[Detection, ...]:
    """Return what vision might say of a table: items moved, turned, missed, confused, and ones that are not there.

    What stands on a missed item is taken to stand on what carries that. Stacks are read right, as they were in all
    measured images; errors of items are independent, which they need not be.
    """
    model = model or error_model()
    detections: list[Detection] = []
    index: dict[str, int | None] = {}
    for item in sorted(table.items, key=lambda item: item.position[2]):
        below = None if item.on is None else index[item.on]
        errors = model.kinds[item.kind]
        if random.random() < errors.miss_rate:
            index[item.name] = below
            continue
        kind = _taken_for(item.kind, errors, random)
        x, y, z = item.position
        dx, dy = random.normal(0.0, errors.position_sigma, 2)
        yaw = 0.0
        if item.kind in UTENSILS:
            yaw = item.yaw + random.normal(0.0, errors.yaw_sigma) + np.pi * (random.random() < errors.turned_rate)
            yaw = float(np.arctan2(np.sin(yaw), np.cos(yaw)))
        detection = Detection(kind=kind, position=(x + float(dx), y + float(dy), z), yaw=yaw, lip=item.lip, on=below)
        if kind in UTENSILS:
            detection = replace(detection, grasp=(detection.position[0], detection.position[1], item.lip))
        index[item.name] = len(detections)
        detections.append(detection)
    for kind, errors in model.kinds.items():
        for _ in range(int(random.poisson(errors.false_rate))):
            x, y = (float(random.uniform(-0.4 * side, 0.4 * side)) for side in TABLE_SIDES)
            detections.append(Detection(kind=kind, position=(x, y, 0.0), confidence=0.9))
    for _ in range(int(random.poisson(model.unknown_rate))):
        x, y = (float(random.uniform(-0.4 * side, 0.4 * side)) for side in TABLE_SIDES)
        unknown = Detection(kind=None, position=(x, y, 0.0), lip=0.02, extent=0.03, confidence=0.0)
        detections.append(replace(unknown, unsure=("unknown object",)))
    return tuple(detections)


def _taken_for(kind: Kind, errors: KindErrors, random: np.random.Generator) -> Kind:
    draw = random.random()
    for other, rate in errors.confused_as.items():
        if draw < rate:
            return other
        draw -= rate
    return kind
