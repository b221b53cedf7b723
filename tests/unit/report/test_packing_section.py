"""The page's section about a packing, of one that was made for it."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenewright.schemas.errors import BadInput
from scenewright.schemas.packing import Packing, PackingAttempt, PackingStep
from scenewright.schemas.plan import Failure
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context
from scenewright.stages.pack.parameters import PackParameters
from scenewright.stages.pack.stage import run as pack
from scenewright.stages.report.sections.packing.view import MOST_ROWS, attempt_row, packing_view

from tests.unit.report.test_report import parse, report


def context(folder: Path) -> Context:
    folder.mkdir()
    return Context(output=folder, seed=0, device="cpu", progress=SilentProgress())


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Packing:
    folder = tmp_path_factory.mktemp("packing") / "packing"
    parameters = PackParameters(suite="hard/unreachable", instance=1, image_width=400)
    return pack(None, None, parameters=parameters, context=context(folder))


def test_the_section_says_what_came_of_it_and_what_ended_every_plan(tmp_path: Path, made: Packing) -> None:
    result = report(tmp_path / "report", packing=made)
    page = parse((tmp_path / "report" / "report.html").read_text())
    sections = {attributes.get("id") for tag, attributes in page.seen if tag == "section"}
    assert sections == {"packing", "cost", "made"} and result.summary["pictures"] == 3
    file = made.info
    assert f"{file.proposer_calls} proposals and {file.motion_planner_calls} motion-planner calls" in page.text
    assert "not packed" not in page.text and "goal reached" in page.text and "Boxes and a basket" in page.text
    cut = [step.failure for attempt in file.attempts for step in attempt.steps if step.failure is not None]
    assert cut and all(failure.message in page.text for failure in cut)


def test_a_torn_picture_is_bad_input_and_a_missing_one_is_left_out(tmp_path: Path, made: Packing) -> None:
    for name in ("packing.json", "instance.json"):
        (tmp_path / name).write_bytes(made.path(name).read_bytes())
    assert packing_view(Packing(tmp_path), 300).pictures == {}
    (tmp_path / "layout.png").write_bytes(b"torn")
    with pytest.raises(BadInput, match=r"layout\.png"):
        packing_view(Packing(tmp_path), 300)


def test_of_many_plans_the_last_are_shown(tmp_path: Path, made: Packing) -> None:
    many = made.info.model_copy(update={"attempts": made.info.attempts[:1] * (MOST_ROWS + 5)})
    many.write(tmp_path / "packing.json")
    (tmp_path / "instance.json").write_bytes(made.path("instance.json").read_bytes())
    view = packing_view(Packing(tmp_path), 300)
    assert (view.hidden, len(view.rows), view.rows[-1].number) == (5, MOST_ROWS, MOST_ROWS + 5)


def test_rows_count_what_was_put_down() -> None:
    steps = (
        PackingStep(name="pick", box="a", tried=True),
        PackingStep(name="place", box="a", x=0.5, y=0.1, yaw=0.0, tried=True),
        PackingStep(name="pick", box="b", tried=True, failure=Failure(kind="no_path", message="walled in")),
        PackingStep(name="place", box="b", x=0.6, y=0.1, yaw=0.0, tried=False),
    )
    row = attempt_row(3, PackingAttempt(steps=steps))
    assert (row.placed, row.ended_at, row.why, row.kind) == ("1 of 2", "pick b", "walled in", "no_path")
    missed = PackingAttempt(steps=steps[:2], task=Failure(kind="not_in_basket", message="a is not in the basket"))
    assert attempt_row(1, missed).why == "a is not in the basket"
