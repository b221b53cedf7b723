"""Panoptic maps."""

from scenewright.stages.kit.viewing.maps import draw_panoptic_map

__all__ = ["draw_panoptic_map"]
