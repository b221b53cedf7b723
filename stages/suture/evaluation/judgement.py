"""One estimate of one needle's pose beside the truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scenewright.schemas.base import Model
from scenewright.stages.suture.needle.filter import difference
from scenewright.stages.suture.needle.observation import NeedleEstimate
from scenewright.stages.suture.rig import NeedlePose


class TrueView(Protocol):
    """What is true of a view: the pose, who holds the needle where, the smaller eye's share of the arc (0 to 1)."""

    @property
    def pose(self) -> NeedlePose: ...  # noqa: D102

    @property
    def holder(self) -> str: ...  # noqa: D102

    @property
    def place(self) -> str: ...  # noqa: D102

    @property
    def seen(self) -> float: ...  # noqa: D102


@dataclass(frozen=True)
class NeedleTruth:
    """The same as an artifact keeps it."""

    pose: NeedlePose
    holder: str
    place: str
    seen: float


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
    seconds: float = 0.0
    """CPU time; 0 where it was not measured."""

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


def judged(arm: str, case: str, seed: int, truth: TrueView, answer: NeedleEstimate, seconds: float = 0.0) -> Estimate:
    """Return the record of one answer."""
    true = truth.pose
    common: dict[str, Any] = {
        "arm": arm,
        "case": case,
        "seed": seed,
        "holder": truth.holder,
        "place": truth.place,
        "degrees_from_edge_on": true.degrees_from_edge_on(),
        "seen": truth.seen,
        "answered": answer.pose is not None and not answer.abstained,
        "guessed": answer.pose is not None,
        "reason": answer.abstained,
        "tip_probability": answer.tip_probability,
        "seconds": seconds,
    }
    pose = answer.pose
    if pose is None:
        errors: dict[str, Any] = dict.fromkeys(
            ("normal_error_deg", "centre_error_mm", "tip_error_mm", "swage_error_mm", "end_error_mm"), -1.0
        )
        return Estimate(**common, **errors, swapped=False, mahalanobis=-1.0)
    to_tip, to_swage = np.linalg.norm(pose.tip - true.tip), np.linalg.norm(pose.tip - true.swage)
    swapped = bool(to_swage < to_tip)
    pose_of_named_ends = pose.swapped() if swapped else pose
    mahalanobis = -1.0
    if np.isfinite(answer.covariance).all():
        step = difference(pose_of_named_ends, true)
        mahalanobis = float(step @ np.linalg.solve(answer.covariance, step))
    return Estimate(
        **common,
        normal_error_deg=float(np.degrees(np.arccos(min(1.0, abs(float(pose.normal @ true.normal)))))),
        centre_error_mm=1000.0 * float(np.linalg.norm(pose.centre - true.centre)),
        tip_error_mm=1000.0 * float(to_tip),
        swage_error_mm=1000.0 * float(np.linalg.norm(pose.swage - true.swage)),
        end_error_mm=1000.0
        * float(
            max(
                np.linalg.norm(pose_of_named_ends.tip - true.tip), np.linalg.norm(pose_of_named_ends.swage - true.swage)
            )
        ),
        swapped=swapped,
        mahalanobis=mahalanobis,
    )
