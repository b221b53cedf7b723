"""Backend `geometric`: no masks, only the segments of the depth."""

from __future__ import annotations

from scenewright.stages.segment.registry import BackendDeclaration

BACKEND = BackendDeclaration(
    name="geometric", summary="no masks: `fuse` finds things by geometry alone", order=20, apart=True, nameless=True
)
