"""Declaration of the section `graph`."""

from __future__ import annotations

from scenewright.schemas.contact_graph import ContactGraph
from scenewright.stages.report.section import Section

SECTION = Section(
    "graph",
    "Contact graph",
    order=40,
    reads={"contact_graph": ContactGraph},
    became={"contact_graph": "a contact graph"},
)
