"""The record of every artifact on the page."""

from __future__ import annotations

from typing import Any

from scenewright.schemas.manifest import CONVENTIONS
from scenewright.stages.report.page import Page


def view(page: Page) -> dict[str, Any]:
    """Return how every artifact was made, with links to its files."""
    conventions = "; ".join(f"{name.replace('_', ' ')}: {text}" for name, text in CONVENTIONS.items())
    return {"made": page.made, "conventions": conventions}
