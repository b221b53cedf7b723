"""ScanNet's exported frames."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout(
    "scannet", order=50, recognised_by="color/, depth/, pose/ and intrinsic/ or _info.txt", reader=f"{__name__}.reader"
)
