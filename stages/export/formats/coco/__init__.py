"""COCO panoptic and instances: pictures with masks, to train and to score networks on.

Formats: https://cocodataset.org/#format-data
"""

from __future__ import annotations

from scenewright.stages.export.registry import SequenceFormat

FORMAT = SequenceFormat(
    name="coco",
    order=35,
    layout="coco",
    summary="COCO panoptic",
    streams=("color", "labels"),
    log="panoptic.json",
    masks=True,
)
