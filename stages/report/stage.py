"""The step `report`: gathers the sections of the page."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from scenewright.schemas.artifact import Artifact
from scenewright.schemas.errors import BadInput
from scenewright.schemas.evaluation import Report, ReportFile
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.declared import load_beside
from scenewright.stages.kit.stage import Context
from scenewright.stages.report.page import Page, render, render_page
from scenewright.stages.report.parameters import STAGE, ReportParameters
from scenewright.stages.report.section import all_sections, package_of

MAXIMUM_BYTES = 15_000_000
"""Largest report [bytes]; a larger one is refused."""


def run(*, parameters: ReportParameters, context: Context, **inputs: Artifact | None) -> Report:
    """Write report.html, one file that needs no network, and report.json. Whatever is missing has no section.

    `inputs` are artifacts by role: what the sections read.
    """
    artifacts = {role: artifact for role in STAGE.reads if (artifact := inputs.get(role)) is not None}
    page = Page(artifacts, parameters, context.output.parent / "report")
    head = {"label": page.label, "baseline_label": page.baseline_label}
    rendered: list[dict[str, Any]] = []
    tiles: list[Any] = []
    scripts: list[str] = []
    for section in all_sections():
        if section.reads and not any(page.given(role, kind) for role, kind in section.reads.items()):
            continue
        with context.progress.step(section.name):
            package = package_of(section)
            values = load_beside(package.__name__, "view").view(page)
        if values is not None:
            html = render("section.html.j2", {**head, **values}, Path(package.__path__[0]))
            rendered.append({"id": section.name, "name": section.title, "html": html})
            tiles += values.get("tiles", ())
            scripts += values.get("scripts", ())
    title = parameters.title or _title(page)
    values = {"title": title, "lead": _lead(page), "tiles": tiles, "sections": rendered, "version": _version()}
    page_text = render_page({**head, **values, "scripts": scripts})
    return _write(page_text, title, tuple(section["id"] for section in rendered), artifacts, context)


def _version() -> str:
    try:
        return version("scenewright")
    except PackageNotFoundError:
        return ""


def _title(page: Page) -> str:
    for section in all_sections():
        if section.alone and set(page.artifacts) <= set(section.reads):
            return section.alone
    ground_truth = page.given("ground_truth", GroundTruth)
    if ground_truth is not None and ground_truth.info.source == "generated":
        return "A generated room, reconstructed"
    return "A scanned room, reconstructed" if "sequence" in page.artifacts else "A reconstructed room"


def _lead(page: Page) -> str:
    clauses = []
    sequence, ground_truth = page.given("sequence", Sequence), page.given("ground_truth", GroundTruth)
    if sequence is not None:
        info = sequence.info
        camera = f"{info.camera.width} x {info.camera.height}"
        clauses.append(
            f"{info.frame_count} RGB-D frames of {camera} pixels over {info.end_time - info.start_time:.0f} s"
        )
    results = [
        text(page.artifacts[role]) if callable(text) else text
        for section in all_sections()
        for role, text in section.became.items()
        if role in page.artifacts
    ]
    if results:
        clauses.append(", ".join(results[:-1]) + (" and " if len(results) > 1 else "") + results[-1])
    text = " became ".join(clauses) if len(clauses) == 2 else "".join(clauses)
    truth = ""
    if ground_truth is not None:
        file = ground_truth.info
        truth = f" The room was generated (recipe {file.recipe}, seed {file.seed}), so the truth is known."
        if file.source == "scan":
            truth = f" What is true of the room was annotated by people ({file.recipe})."
    return (text[:1].upper() + text[1:] + "." if text else "") + truth


def _write(
    page: str, title: str, sections: tuple[str, ...], artifacts: dict[str, Artifact], context: Context
) -> Report:
    try:
        size = len(page.encode("utf-8"))
    except UnicodeEncodeError as error:
        raise BadInput(
            f"the page would name {page[max(0, error.start - 40) : error.end]!r}, which is not UTF-8",
            hint="make the artifact again, without files of others in it",
        ) from None
    if size > MAXIMUM_BYTES:
        raise BadInput(
            f"the report would have {size / 1e6:.0f} MB", hint="use smaller --frame-width, --view-width or --frames"
        )
    context.output.joinpath("report.html").write_text(page, encoding="utf-8")
    sources = {role: a.manifest.content_digest if a.manifest is not None else "" for role, a in artifacts.items()}
    ReportFile(title=title, sections=sections, sources=sources).write(context.output / "report.json")
    return Report(context.output, summary={"sections": len(sections), "pictures": page.count("data:image/")})
