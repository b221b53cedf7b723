"""Detections as JSON and back."""

from __future__ import annotations

from scenewright.schemas.base import as_transform
from scenewright.schemas.errors import BadInput
from scenewright.schemas.tableware_detections import (
    DetectedSize,
    TablePlane,
    TablewareDetection,
    TablewareDetectionsFile,
)
from scenewright.schemas.tableware_dishes import TablewareDishes
from scenewright.stages.tableware.vision.detections import Detection
from scenewright.stages.tableware.vision.seeing import Sight, Sizes
from scenewright.stages.tableware.world.items import Measures


def to_file(sight: Sight, sizes: Sizes, dishes: TablewareDishes | None = None) -> TablewareDetectionsFile:
    """Return the payload of what was seen."""
    return TablewareDetectionsFile(
        statement=sight.statement,
        notes=sight.notes,
        items=tuple(_item(detection) for detection in sight.detections),
        camera=sight.camera,
        world_from_camera=as_transform(sight.world_from_camera),
        table=TablePlane(normal=sight.plane[0], offset=sight.plane[1]),
        workspace=sight.sides,
        rectified=sight.rectified,
        sizes=sizes,
        dishes=dishes,
    )


def from_file(file: TablewareDetectionsFile) -> tuple[Detection, ...]:
    """Return the detections of a payload. Raises BadInput where heights are not known: nothing can be planned then."""
    if not file.heights_known:
        raise BadInput(
            "the detections are of a photograph without depth: heights are unknown", hint="detect on an RGB-D image"
        )
    return tuple(
        Detection(
            kind=item.kind,
            position=item.position,
            yaw=item.yaw,
            lip=item.lip,
            on=item.on,
            hidden=item.hidden,
            grasp=item.grasp,
            extent=item.extent,
            confidence=item.confidence,
            unsure=item.unsure,
            size=None if item.size is None else Measures(**item.size.model_dump()),
        )
        for item in file.items
    )


def _item(detection: Detection) -> TablewareDetection:
    size = None
    if detection.size is not None:
        size = DetectedSize(
            height=detection.size.height,
            rim_radius=detection.size.rim_radius,
            foot_radius=detection.size.foot_radius,
            wall=detection.size.wall,
        )
    return TablewareDetection(
        kind=detection.kind,
        position=detection.position,
        yaw=detection.yaw,
        lip=max(0.0, detection.lip),
        on=detection.on,
        hidden=detection.hidden,
        grasp=detection.grasp,
        extent=detection.extent,
        size=size,
        confidence=min(1.0, max(0.0, detection.confidence)),
        unsure=detection.unsure,
    )
