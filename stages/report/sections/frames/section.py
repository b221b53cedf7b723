"""Declaration of the section `frames`."""

from __future__ import annotations

from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.segments import Segments
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.report.section import Section

SECTION = Section(
    "frames",
    "Frames",
    order=10,
    reads={"ground_truth": GroundTruth, "sequence": Sequence, "trajectory": Trajectory, "segments": Segments},
)
