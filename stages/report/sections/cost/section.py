"""Declaration of the section `cost`."""

from __future__ import annotations

from scenewright.stages.report.section import Section

SECTION = Section("cost", "Time and memory", order=120)
