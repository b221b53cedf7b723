"""Declaration of the section `made`."""

from __future__ import annotations

from scenewright.stages.report.section import Section

SECTION = Section("made", "How it was made", order=130)
