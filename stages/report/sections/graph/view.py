"""The contact graph, with what a comparison with the true one found wrong."""

from __future__ import annotations

from typing import Any

from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.errors import BadInput
from scenewright.schemas.evaluation import Evaluation
from scenewright.stages.report.graph_drawing import draw_graph, marks_from_evaluation
from scenewright.stages.report.page import Page


def view(page: Page) -> dict[str, Any] | None:
    """Return the drawn graph. Raises BadInput when it is no tree."""
    contact_graph, evaluation = page.given("contact_graph", ContactGraph), page.given("evaluation", Evaluation)
    if contact_graph is None:
        return None
    graph = contact_graph.info
    marks, missing = marks_from_evaluation(evaluation.root) if evaluation is not None else ({}, ())
    try:
        drawn = draw_graph(graph, marks, missing)
    except ValueError as error:
        raise BadInput(f"{contact_graph.path('graph.json')}: {error}", hint="make the graph again") from None
    counts: dict[str, int] = {}
    for link in graph.links:
        counts[link.relation] = counts.get(link.relation, 0) + 1
    edges = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in sorted(counts.items()))
    text = f"{len(graph.nodes) - 1} entities; relations: {edges or 'none'}."
    errors: dict[str, int] = {}
    for mark in marks.values():
        name = mark.split(",")[0]
        errors[name] = errors.get(name, 0) + 1
    plurals = {"wrong class": "wrong classes"}
    wrong = ", ".join(
        f"{count} {name if count == 1 else plurals.get(name, name + 's')}" for name, count in sorted(errors.items())
    )
    return {"graph": drawn, "graph_text": text, "graph_errors": wrong}
