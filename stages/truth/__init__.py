"""Ground truth of data sets that others annotated."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.truth.annotated_points import instances_of, most_common_labels, seen_points
    from scenewright.stages.truth.support_annotation import AnnotatedNode, SupportAnnotation, read_support_annotation

__getattr__ = exported(__name__)
