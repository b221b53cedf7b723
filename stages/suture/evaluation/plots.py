"""The histogram of sutures to failure, as figure 4.1 (Srinivas 2024), and the errors of needle poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scenewright.schemas.suture_trial import SutureRun
from scenewright.stages.kit.drawing.plots import SERIES_COLORS, STYLE, plt, save
from scenewright.stages.suture.evaluation.judgement import Estimate
from scenewright.stages.suture.evaluation.needle_figures import by_arm
from scenewright.stages.suture.motion.constants import THROWS

COLORS = {"thesis": SERIES_COLORS[4], "ours": SERIES_COLORS[0]}
"""Arm -> colour of its bars; other arms get the colours that are left."""


def histogram(path: Path, runs: Sequence[SutureRun]) -> None:
    """Draw the share of each arm's trials by the number of sutures to failure (0 to 6)."""
    arms = list(dict.fromkeys(run.arm for run in runs))
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(7.2, 3.4))
        width = 0.84 / max(1, len(arms))
        for k, arm in enumerate(arms):
            thrown = np.array([run.sutures for run in runs if run.arm == arm])
            shares = [float((thrown == count).mean()) for count in range(THROWS + 1)]
            places = np.arange(THROWS + 1) + (k - (len(arms) - 1) / 2) * width
            color = SERIES_COLORS[k % len(SERIES_COLORS)]
            axes.bar(places, shares, width, label=f"{arm} ({len(thrown)})", color=color, alpha=1.0 if k < 5 else 0.5)
        axes.set_xlabel("sutures to failure")
        axes.set_ylabel("share of trials")
        axes.legend(fontsize=8)
        save(figure, path)


def pose_errors(path: Path, groups: Mapping[str, list[Estimate]]) -> None:
    """Draw normal and centre errors of all answers of `needle_all` (or of the last group), with the grasp tolerance."""
    records = groups.get("needle_all", next(reversed(list(groups.values()))))
    others = (color for color in SERIES_COLORS if color not in COLORS.values())
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(5.4, 3.6))
        for arm, rows in by_arm(records).items():
            color = COLORS.get(arm) or next(others)
            for answered, marker in ((True, "o"), (False, "x")):
                chosen = [record for record in rows if record.answered == answered and record.guessed]
                if not chosen:
                    continue
                name = arm if answered else f"{arm}, abstained"
                axes.plot(
                    [max(record.centre_error_mm, 1e-2) for record in chosen],
                    [max(record.normal_error_deg, 1e-2) for record in chosen],
                    marker,
                    color=color,
                    markersize=4.5,
                    alpha=0.8,
                    label=f"{name} ({len(chosen)})",
                )
        axes.plot([1e-2, 1.0, 1.0], [10.0, 10.0, 1e-2], color="#555555", linewidth=0.9, label="grasp tolerance")
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("centre error [mm]")
        axes.set_ylabel("normal error [degrees]")
        axes.legend(fontsize=7.5)
        save(figure, path)
