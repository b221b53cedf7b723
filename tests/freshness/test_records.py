"""Every step's code is what was recorded under its version."""

from __future__ import annotations

import pytest
from scenewright.stages.engine.discovery import all_stages

from tests.freshness.program import Program
from tests.freshness.records import FOLDER, REPOSITORY, code_of, complaint, path_of, read_record
from tests.freshness.runs import RUNS


@pytest.fixture(scope="module")
def program() -> Program:
    return Program(REPOSITORY)


@pytest.mark.parametrize("name", all_stages())
def test_the_code_of_a_step_is_recorded_under_its_version(program: Program, name: str) -> None:
    stage = all_stages()[name]
    wrong = complaint(stage, read_record(name), code_of(program, stage))
    assert wrong is None, wrong


def test_nothing_is_remembered_of_steps_that_are_gone() -> None:
    assert {path.name for path in FOLDER.glob("*")} == {path_of(name).name for name in all_stages()}


def test_runs_are_of_steps_and_need_runs_before_them() -> None:
    before: set[str] = set()
    for run in RUNS:
        assert run.step in all_stages() and set(run.needs()) <= before and run.name not in before, run
        before.add(run.name)
        stage = all_stages()[run.step]
        options = {"seed", *stage.reads, *stage.parameters.model_fields}
        assert {word[2:].replace("-", "_") for word in run.options.split() if word[:2] == "--"} <= options, run
