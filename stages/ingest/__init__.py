"""Step `ingest`: a robot's RGB-D log becomes a sequence in our conventions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.ingest.detection import open_log
    from scenewright.stages.ingest.parameters import IngestParameters
    from scenewright.stages.ingest.preflight.inspection import inspect_source
    from scenewright.stages.ingest.preflight.report import CameraReport, InspectionReport
    from scenewright.stages.ingest.source import LoadedFrame, LogSource

__getattr__ = exported(__name__)
