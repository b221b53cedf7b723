"""Declaration of the section `frames`."""

from __future__ import annotations

from schemas.ground_truth import GroundTruth
from schemas.segments import Segments
from schemas.sequence import Sequence
from schemas.trajectory import Trajectory
from stages.report.section import Section

SECTION = Section(
    "frames",
    "Frames",
    order=10,
    reads={"ground_truth": GroundTruth, "sequence": Sequence, "trajectory": Trajectory, "segments": Segments},
)
