"""The finds of fuzzing the commands, replayed; and what the harness itself is made of. `make fuzz` looks further."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from scenewright.stages.engine.verification import verify

from tests.fuzz.commands import base
from tests.fuzz.commands.case import Case, Edit, read_case
from tests.fuzz.commands.edits import apply
from tests.fuzz.commands.judging import where
from tests.fuzz.commands.run import COMMANDS, smaller
from tests.fuzz.commands.workspace import names_in, prepare
from tests.fuzz.harness import CORPUS

KEPT = sorted(COMMANDS.glob("*.json"))
PUT = Edit("graph", "graph.json", "put", (["nodes", 0, "confidence"], 0.25))


@pytest.mark.slow
def test_every_find_stands() -> None:
    """In one process with all of them, as a fork for each is what makes it fast."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.fuzz.commands.run", "--replay"],
        cwd=CORPUS.parents[2],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr[-1000:]
    assert done.stdout.count("stood: ") == len(KEPT) > 0


@pytest.mark.parametrize("path", KEPT, ids=lambda path: path.stem)
def test_finds_start_from_what_is_kept(path: Path) -> None:
    case = read_case(path)
    assert case.text() == path.read_text()
    edited = {edit.target for edit in case.edits}
    assert edited <= set(base.KEPT), "python -m tests.fuzz.commands.base FOLDER --keep, with it in KEPT"


@pytest.fixture
def graphs(tmp_path: Path) -> Path:
    shutil.copytree(CORPUS.parents[1] / "golden" / "v1" / "contact_graph", tmp_path / "base" / "graph")
    return tmp_path


def test_an_edit_passes_verification_and_the_base_stays(graphs: Path) -> None:
    words = prepare(Case(("verify", "@graph"), (PUT,)), graphs / "base", graphs / "case")
    edited = Path(words[1])
    assert '"confidence": 0.25' in (edited / "graph.json").read_text()
    assert verify(edited)[0].problems == () and verify(graphs / "base" / "graph")[0].problems == ()
    assert apply(PUT.how, edited / "graph.json", (["nodes", 0, "confidence"], 0.5))
    assert verify(edited)[0].problems != ()


def test_what_does_not_fit_is_passed_over(graphs: Path) -> None:
    assert not apply("put", graphs / "base" / "graph" / "graph.json", (["nodes", 10**6, "id"], "x"))
    assert not apply("mesh", graphs / "base" / "graph" / "graph.json", ("empty",))


def test_clones_are_named_everywhere(graphs: Path) -> None:
    document = graphs / "base" / "graph" / "graph.json"
    before = document.read_text()
    name = re.search(r'"target": "(\w+)"', before)
    assert name is not None and apply("clone", document, ("name", name[1], 3))
    after = document.read_text()
    assert all(f'"id": "{name[1]}_{k}"' in after and f'"target": "{name[1]}_{k}"' in after for k in range(3))


def test_smaller_cases() -> None:
    case = Case(("graph", "--panoptic-map", "@map", "--json", "--out", "@out"), (PUT, PUT))
    found = smaller(case)
    assert sum(len(entry.edits) == 1 for entry in found) == 2
    assert ("graph", "--panoptic-map", "@map", "--out", "@out") in [entry.words for entry in found]
    assert all("--out" in entry.words for entry in found)
    assert names_in(case) == ["map", "graph"] and case.command == "graph"


def test_where_it_happened() -> None:
    calls = '  File "/x/stages/fuse/stage.py", line 3, in run\n  File "/lib/n.py", line 1, in f\n'
    text = f"Traceback\n{calls}ValueError: no\n"
    assert where(text) == "ValueError at stages/fuse/stage.py run"
