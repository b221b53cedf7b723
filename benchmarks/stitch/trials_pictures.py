"""The histogram of sutures to failure, as figure 4.1 (Srinivas 2024)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.stitch.trials_records import Run
from stages.kit.measurement.plots import SERIES_COLORS, STYLE, plt, save
from stages.suture.motion.constants import THROWS


def histogram(path: Path, runs: list[Run]) -> None:
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
