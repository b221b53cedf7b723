"""One estimate of one needle's pose, as a line of needle.jsonl."""

from __future__ import annotations

from pathlib import Path

from benchmarks.run_log import read_log
from schemas.base import Model


class Estimate(Model):
    """What an arm said of one view (or of ten frames), and how far off it was.

    `normal_error_deg` is between the planes, whichever way the normals point; `swapped`: the estimated tip lies nearer
    to the true swage; `tip_error_mm`, `swage_error_mm` are to the true ends as named, `end_error_mm` is the larger of
    both with the ends named as fits best; `mahalanobis`: squared, 6 degrees of freedom, by the estimate's covariance
    and with the ends named as fits best (-1: no covariance). An arm without even a guess has errors of -1.
    """

    arm: str
    case: str
    seed: int
    holder: str
    place: str
    degrees_from_edge_on: float
    seen: float
    answered: bool
    guessed: bool
    reason: str
    normal_error_deg: float
    centre_error_mm: float
    tip_error_mm: float
    swage_error_mm: float
    end_error_mm: float
    swapped: bool
    mahalanobis: float
    tip_probability: float
    seconds: float

    @property
    def within(self) -> bool:
        """Answered, the centre within 1 mm and the plane within 10 degrees."""
        return self.answered and self.right

    @property
    def right(self) -> bool:
        """The guess is within 1 mm and 10 degrees, whether it was given as an answer or not."""
        return self.guessed and self.normal_error_deg <= 10.0 and self.centre_error_mm <= 1.0

    @property
    def visible(self) -> bool:
        """The needle's plane is more than 15 degrees from edge-on."""
        return self.degrees_from_edge_on > 15.0


def read_estimates(path: Path) -> list[Estimate]:
    """Return the estimates of a log; a line that was cut off at the end is taken out of the file."""
    return read_log(path, Estimate)
