"""The page's section about a plan of cuts."""

from __future__ import annotations

from pathlib import Path

from scenewright.schemas.cutting_plan import CuttingPlan, CuttingPlanFile, WantedFragment

from tests.unit.report.test_report import parse, report


def test_the_section_shows_statement_and_tree(tmp_path: Path) -> None:
    plan = tmp_path / "plan"
    plan.mkdir()
    CuttingPlanFile(
        method="ours",
        goal="words: 1 chunk",
        objects=1,
        wanted=(WantedFragment(edges=(0.02, 0.03, 0.1), volume=6e-5),),
        goal_bodies=0,
        cuts=(),
        refusals=(),
        stopped=None,
        scores=None,
        sure=None,
        statement="0 cuts make 1 fragments",
    ).write(plan / "plan.json")
    (plan / "plan.txt").write_text("0 <whole>\n")
    report(tmp_path / "report", cutting_plan=CuttingPlan(root=plan, summary={}))
    page = parse((tmp_path / "report" / "report.html").read_text())
    assert "cutting" in {attributes.get("id") for tag, attributes in page.seen if tag == "section"}
    assert "0 cuts make 1 fragments" in page.text and "0 <whole>" in page.text
