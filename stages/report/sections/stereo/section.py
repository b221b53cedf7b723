"""Declaration of the section `stereo`."""

from __future__ import annotations

from schemas.sequence import Sequence
from stages.report.section import Section

SECTION = Section(
    "stereo",
    "Stereo",
    order=20,
    reads={"sequence": Sequence},
)
