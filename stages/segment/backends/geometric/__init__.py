"""Backend `geometric`: class-agnostic, the segments of the depth."""

from __future__ import annotations

from scenewright.stages.segment.registry import BackendDeclaration

BACKEND = BackendDeclaration(name="geometric", summary="every geometric segment is an `object`", order=20, apart=True)
