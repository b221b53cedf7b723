"""Declaration of the section `stereo`."""

from __future__ import annotations

from schemas.disparity import Disparity
from stages.report.section import Section

SECTION = Section("stereo", "Stereo", order=20, reads={"sequence": Disparity})
