"""What decides the bytes of the step beside its inputs: the segmentation service that it asks."""

from scenewright.stages.kit.acting.eyes.identity import versions

__all__ = ["versions"]
