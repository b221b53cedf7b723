"""What of the reconstruction can be relied on, first of all."""

from __future__ import annotations

from typing import Any

from scenewright.stages.report.outlook import Facts, outlook
from scenewright.stages.report.page import Page


def view(page: Page) -> dict[str, Any] | None:
    """Return the groups of sentences; None when there is nothing to say."""
    found = outlook({role: Facts(artifact.outcome, artifact.summary) for role, artifact in page.artifacts.items()})
    groups = [
        ("To rely on", found.sound),
        ("Not to rely on", found.doubtful),
        ("Not seen", found.missing),
        ("What to do next", found.advice),
    ]
    shown = [(title, texts) for title, texts in groups if texts]
    return {"groups": shown} if shown else None
