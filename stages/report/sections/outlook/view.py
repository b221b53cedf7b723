"""What of the reconstruction can be relied on, first of all."""

from __future__ import annotations

from typing import Any

from scenewright.stages.report.outlook import Facts, outlook
from scenewright.stages.report.page import Page


def view(page: Page) -> dict[str, Any] | None:
    """Return the groups of sentences; None when there is nothing to say."""
    verdict = outlook({role: Facts(artifact.outcome, artifact.summary) for role, artifact in page.artifacts.items()})
    groups = [
        ("To rely on", verdict.sound),
        ("Not to rely on", verdict.doubtful),
        ("Not seen", verdict.missing),
        ("What to do next", verdict.advice),
    ]
    groups_with_texts = [(title, texts) for title, texts in groups if texts]
    return {"groups": groups_with_texts} if groups_with_texts else None
