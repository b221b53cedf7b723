"""A policy and an action are one new file each: found by their place, offered, planned with and kept."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from scenewright.schemas.errors import UsageError
from scenewright.schemas.tableware_plan import FIELD_OF
from scenewright.stages.tableware import actions, policies
from scenewright.stages.tableware.found_by_place import module_named, names_in
from scenewright.stages.tableware.options import PolicyName
from scenewright.stages.tableware.planning.choice import declared_policy

REPOSITORY = Path(__file__).resolve().parents[3]
NEWEST_FIRST = '''
"""Takes what was seen last."""

from scenewright.stages.tableware.actions.grasp import grasp
from scenewright.stages.tableware.planning.policy import DeclaredPolicy


class NewestFirst:
    def decide(self, table):
        return grasp(table, table.tops[-1].name)


POLICY = DeclaredPolicy(lambda rules, model, chances, seed: NewestFirst())
'''


def with_a_policy_more(folder: Path, arguments: list[str]) -> subprocess.CompletedProcess[str]:
    """Run the command line with a folder of policies more, which holds `newest_first.py`."""
    folder.joinpath("newest_first.py").write_text(NEWEST_FIRST)
    code = (
        "import sys, scenewright.stages.tableware.policies as policies;"
        f"policies.__path__.append({str(folder)!r});"
        f"from scenewright.cli.main import run; sys.exit(run({arguments!r}))"
    )
    return subprocess.run([sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=False)


def test_a_policy_is_one_file(tmp_path: Path) -> None:
    folder = tmp_path / "policies"
    folder.mkdir()
    shown = with_a_policy_more(folder, ["tableware", "plan", "--help"])
    assert shown.returncode == 0 and "newest_first" in " ".join(shown.stdout.split())
    scenes = ["--tier", "tier0_cups", "--scenes", "1", "--draws", "2"]
    out = tmp_path / "evaluation"
    done = with_a_policy_more(
        folder, ["tableware", "evaluate", *scenes, "--policies", "newest_first", "--out", str(out), "--quiet"]
    )
    assert done.returncode == 0, done.stderr
    assert "`newest_first`" in (out / "table.md").read_text()


def test_every_policy_is_offered_and_an_unknown_one_is_refused() -> None:
    assert PolicyName.__args__ == names_in(policies)  # type: ignore[attr-defined]
    assert all(declared_policy(rival) for name in names_in(policies) for rival in declared_policy(name).rivals)
    with pytest.raises(UsageError, match="there is no 'newest_first'"):
        declared_policy("newest_first")


def test_every_action_is_a_file_and_a_field() -> None:
    assert names_in(actions) == tuple(sorted(FIELD_OF))
    assert all(module_named(actions, name).ACTION.name == name for name in FIELD_OF)
