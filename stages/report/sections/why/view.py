"""Why every entity has its name, its support, its model and its joints: the sentences of `scenewright explain`."""

from __future__ import annotations

from typing import Any

from scenewright.stages.kit.explaining.sources import entity_names, sentences
from scenewright.stages.report.page import Page


def view(page: Page) -> dict[str, Any] | None:
    """Return what is said of every entity; None where nothing is. Raises BadInput for a payload that is damaged."""
    said = sentences(page.sources)
    entities = [(name, said[name]) for name in entity_names(page.sources) if said.get(name)]
    return {"entities": entities} if entities else None
