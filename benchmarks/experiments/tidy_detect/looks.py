"""The records of vision."""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.experiments.tidy_detect.score import Match


@dataclass(frozen=True)
class Look:
    """One arm's look at one image."""

    tier: str
    level: str
    scheme: str
    seconds: float
    """CPU time."""
    quiet: float | None
    """Least CPU time of several."""
    matches: tuple[Match, ...]


Looks = tuple[Look, ...]
"""At one scene, under all its conditions."""
