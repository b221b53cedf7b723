"""Kinds `evaluation` and `report`."""

from __future__ import annotations

from typing import ClassVar

from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model


class MetricsFile(Model):
    """metrics.json: flat, `<part>/<measure>` -> number (`map/pq`, `graph/edit_distance`)."""

    label: str
    """Which masks and which room the figures are about; printed beside every figure."""
    metrics: dict[str, float | None]
    """None where a measure is undefined (no instance of the class, say)."""
    notes: tuple[str, ...] = ()


class Evaluation(Artifact):
    """`metrics.json`, `tables/*.csv` and `*.md`, `plots/*.png`."""

    kind: ClassVar[str] = "evaluation"
    description: ClassVar[str] = "figures against ground truth, with tables and plots"
    info = Document(MetricsFile, "metrics.json")


class ReportFile(Model):
    """report.json: which sections the page has, and from which artifacts (content digests)."""

    title: str
    sections: tuple[str, ...]
    sources: dict[str, str]


class Report(Artifact):
    """`report.html`: one file, no network. It prints wall-clock times, therefore no digest covers it."""

    kind: ClassVar[str] = "report"
    description: ClassVar[str] = "one self-contained HTML page about a run"
    undigested: ClassVar[tuple[str, ...]] = ("timings.json", "report.html")
    info = Document(ReportFile, "report.json")
