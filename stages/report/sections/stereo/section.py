"""Declaration of the section `stereo`."""

from __future__ import annotations

from scenewright.schemas.disparity import Disparity
from scenewright.stages.report.section import Section

SECTION = Section("stereo", "Stereo", order=20, reads={"sequence": Disparity})
