"""The estimators of the needle's pose by the names of the command line and of perception models."""

from __future__ import annotations

from scenewright.stages.suture.needle import estimate, thesis
from scenewright.stages.suture.needle.estimator import Estimator

ESTIMATORS: dict[str, Estimator] = {"ours": estimate.OURS, "thesis": thesis.THESIS}
