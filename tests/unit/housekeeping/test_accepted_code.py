"""Runs that other code made: made again, or accepted in a list that every manifest carries."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenewright.cli.main import run as command
from scenewright.schemas.accepted_code import AcceptedCodeFile
from scenewright.schemas.errors import BadInput
from scenewright.stages.engine.accepted_code import accept_code
from scenewright.stages.engine.code import digests
from scenewright.stages.engine.code.program import Code
from scenewright.stages.engine.comparison import compare
from scenewright.stages.engine.discovery import all_stages
from scenewright.stages.engine.reading import read_manifest
from scenewright.stages.engine.runner import RunResult, run_stage
from scenewright.stages.engine.verification import verify

from tests.unit.housekeeping.small_step import SMALL, SmallParameters


@pytest.fixture(autouse=True)
def small_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(all_stages(), "small", SMALL)


def make(run: Path, text: str = "one") -> list[RunResult]:
    first = run_stage(SMALL, {}, run / "first", SmallParameters(text=text))
    return [first, run_stage(SMALL, {"upstream": run / "first"}, run / "second", SmallParameters())]


def change_code(monkeypatch: pytest.MonkeyPatch, digest: str) -> None:
    monkeypatch.setattr(digests, "code_of", lambda *roots: Code(digest, {}, frozenset()))


def test_other_code_makes_it_again_and_the_chain_stops_at_the_same_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    change_code(monkeypatch, "a" * 64)
    assert [result.status for result in make(tmp_path)] == ["made", "made"]
    assert [result.status for result in make(tmp_path)] == ["up to date", "up to date"]
    change_code(monkeypatch, "b" * 64)
    first = run_stage(SMALL, {}, tmp_path / "first", SmallParameters(text="one"))
    assert first.status == "made" and first.reason == "changed: code"
    change_code(monkeypatch, "a" * 64)
    assert run_stage(SMALL, {"upstream": tmp_path / "first"}, tmp_path / "second", SmallParameters()).status == (
        "up to date"
    ), "its input has the same content"


def test_accepted_code_lets_a_run_stand_and_is_told_ever_after(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    change_code(monkeypatch, "a" * 64)
    make(tmp_path)
    keys = [read_manifest(tmp_path / name).key for name in ("first", "second")]
    change_code(monkeypatch, "b" * 64)
    assert command(["accept-code", str(tmp_path)]) == 0
    assert "small: made with aaaaaaaaaaaa, accepted as bbbbbbbbbbbb" in capsys.readouterr().err
    assert [result.status for result in make(tmp_path)] == ["up to date", "up to date"]
    assert [read_manifest(tmp_path / name).key for name in ("first", "second")] == keys, "keys say what made it"
    (entry,) = AcceptedCodeFile.read(tmp_path / "accepted_code.json").accepted
    assert (entry.step, entry.made_with, entry.accepted) == ("small", "a" * 64, "b" * 64)
    assert accept_code(tmp_path) == ()

    third = run_stage(SMALL, {"upstream": tmp_path / "second"}, tmp_path / "third", SmallParameters())
    assert third.manifest is not None and third.manifest.accepted_code == (entry,), "what is made of it carries it"
    for finding in verify(tmp_path / "third"):
        assert not finding.problems and any("accepted" in note for note in finding.notes), finding

    other = make(tmp_path / "other")[0].path
    changes = {change.group: change for change in compare(tmp_path / "first", other)[0].changes}
    assert changes["accepted code"].before == "aaaaaaaaaaaa -> bbbbbbbbbbbb"

    change_code(monkeypatch, "c" * 64)
    assert make(tmp_path)[0].status == "made", "accepted was other code than this"


def test_other_parameters_are_not_accepted_with_the_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    change_code(monkeypatch, "a" * 64)
    make(tmp_path)
    change_code(monkeypatch, "b" * 64)
    accept_code(tmp_path)
    first = run_stage(SMALL, {}, tmp_path / "first", SmallParameters(text="two"))
    assert first.status == "made" and first.reason == "changed: parameter text 'one' -> 'two'"


def test_runs_of_before_manifests_named_code_are_accepted_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    change_code(monkeypatch, "a" * 64)
    make(tmp_path)
    path = tmp_path / "first" / "manifest.json"
    text = path.read_text().replace('"format_version": 2', '"format_version": 1,\n "stage_version": 3')
    path.write_text(text.replace(f'"code": "{"a" * 64}",', "").replace(read_manifest(tmp_path / "first").key, "1" * 64))
    assert make(tmp_path / "elsewhere")[0].status == "made"
    (finding,) = verify(tmp_path / "first")
    assert not finding.problems and "names no code" in finding.notes[0]
    dry = run_stage(SMALL, {}, tmp_path / "first", SmallParameters(text="one"), dry_run=True)
    assert dry.reason == "changed: its manifest names no code"
    accept_code(tmp_path)
    assert [result.status for result in make(tmp_path)] == ["up to date", "up to date"]


def test_verify_says_what_it_cannot_check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    change_code(monkeypatch, "a" * 64)
    make(tmp_path)
    change_code(monkeypatch, "b" * 64)
    (finding,) = verify(tmp_path / "first")
    assert finding.notes == (
        "made with code aaaaaaaaaaaa of small, which is bbbbbbbbbbbb here: that its bytes come from its inputs is not "
        "checked",
    )
    monkeypatch.delitem(all_stages(), "small")
    (finding,) = verify(tmp_path / "first")
    assert "no step 'small'" in finding.notes[0]


def test_a_folder_without_artifacts_or_with_a_damaged_one_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(BadInput, match="no artifact"):
        accept_code(tmp_path)
    change_code(monkeypatch, "a" * 64)
    make(tmp_path)
    change_code(monkeypatch, "b" * 64)
    (tmp_path / "second" / "trajectory.tum").write_text("")
    before = (tmp_path / "first" / "manifest.json").read_bytes()
    with pytest.raises(BadInput):
        accept_code(tmp_path)
    assert (tmp_path / "first" / "manifest.json").read_bytes() == before
    assert not (tmp_path / "accepted_code.json").exists()
