"""ScanNet++'s iPhone recordings: rgb.mkv or rgb/, depth/, pose_intrinsic_imu.json."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout("scannetpp", order=63, recognised_by="pose_intrinsic_imu.json", reader=f"{__name__}.reader")
