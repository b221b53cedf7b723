"""The page's section about what words mean."""

from __future__ import annotations

from pathlib import Path

from scenewright.schemas.kitchen_plan import (
    EvaluatedSet,
    KitchenEvaluation,
    KitchenEvaluationFile,
    KitchenPlan,
    KitchenPlanFile,
)
from scenewright.schemas.learned_domain import (
    DialogueTurn,
    HeardPhrase,
    LabelledExample,
    LearnedDomain,
    LearnedDomainFile,
    LearnedPredicate,
    SeenObject,
    SeenState,
)

from tests.unit.report.test_report import HOSTILE, parse, report


def learned_domain(folder: Path) -> LearnedDomain:
    folder.mkdir()
    example = LabelledExample(state=0, objects=("cup",), holds=False, source="sentence", weight=1.0, turn=0)
    LearnedDomainFile(
        domain="set_table",
        teacher="simulated",
        predicates=(LearnedPredicate(name="thin", arguments=1, means="(less (height ?a) 1)", said="thin (a): it is."),),
        phrases=(HeardPhrase(text=HOSTILE, arguments=1, predicate="thin", examples=(example,)),),
        preconditions=(),
        goals=(),
        transitions=(),
        states=(
            SeenState(
                objects={"cup": SeenObject(x=0, y=0, width=3, height=3, category="cup", water=0)},
                gripper_x=0,
                gripper_y=25,
                opening=5,
                mass=0,
            ),
        ),
        dialogue=(DialogueTurn(speaker="teacher", text="object cup is not thin", about="", believed=False),),
        disbelieved=("object cup is not thin",),
        sentences=1,
        questions=0,
        physics=(),
        statement="1 phrase",
    ).write(folder / "domain.json")
    (folder / "domain.pddl").write_text("(define (domain set_table))\n")
    return LearnedDomain(root=folder, summary={})


def test_the_section_shows_predicates_dialogue_plan_and_sets(tmp_path: Path) -> None:
    plan = tmp_path / "plan"
    plan.mkdir()
    KitchenPlanFile(
        domain="set_table", goal="g", wanted=(), success=False, steps=(), missing="", statement="g: no plan"
    ).write(plan / "plan.json")
    sets = tmp_path / "sets"
    sets.mkdir()
    row = EvaluatedSet(which="combined", tasks=10, reached=9, ceiling=10, unplanned=1, failed_actions=0)
    KitchenEvaluationFile(domain="set_table", seed=0, rows=(row,), accuracy={}).write(sets / "results.json")
    report(
        tmp_path / "report",
        learned=learned_domain(tmp_path / "learned"),
        kitchen_plan=KitchenPlan(root=plan, summary={}),
        kitchen_evaluation=KitchenEvaluation(root=sets, summary={}),
    )
    page = parse((tmp_path / "report" / "report.html").read_text())
    assert "words" in {attributes.get("id") for tag, attributes in page.seen if tag == "section"}
    for text in ("it is.", HOSTILE, "(no longer believed)", "g: no plan", "9 of 10", "(define (domain set_table))"):
        assert text in page.text
