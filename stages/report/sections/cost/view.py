"""Time and memory of every step."""

from __future__ import annotations

from typing import Any

from scenewright.stages.report.page import Page


def view(page: Page) -> dict[str, Any]:
    """Return what every artifact cost."""
    return {"made": page.made, "timed": any(entry.known for entry in page.made)}
