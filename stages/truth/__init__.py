"""Ground truth of data sets that others annotated."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.truth.annotated_points import instances_of
    from scenewright.stages.truth.support_annotation import AnnotatedNode, SupportAnnotation, read_support_annotation

_MODULES = {
    "instances_of": "scenewright.stages.truth.annotated_points",
    "AnnotatedNode": "scenewright.stages.truth.support_annotation",
    "SupportAnnotation": "scenewright.stages.truth.support_annotation",
    "read_support_annotation": "scenewright.stages.truth.support_annotation",
}

__getattr__ = exported(__name__, _MODULES)
