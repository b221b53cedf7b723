"""`urdf check` beside urdf-validator of PyPI on the same bad files: what that finds, ours finds."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenewright.cli.main import run
from scenewright.stages.kit.formats.urdf_check import advice, check_urdf

from tests.bad_input.broken_urdf import BROKEN, INERTIA, link, robot

pytest.importorskip("urdf_validator_main", reason="needs urdf-validator")
BOX = '<geometry><box size="1 1 1"/></geometry>'
MORE = {
    "no inertia at all": link(
        '<inertial><mass value="1"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>'
    ),
    "no limits": robot("", '<joint name="j" type="revolute"><parent link="a"/><child link="b"/></joint>'),
    "negative mass on a hinge": f'<robot name="r"><link name="a"/><link name="b">{INERTIA}</link></robot>'.replace(
        'value="1"', 'value="-1"'
    ),
}
"""What it looks for and the files of BROKEN do not have."""
TOUCHLESS = (
    robot("", "")
    .replace(INERTIA, f"{INERTIA}<visual>{BOX}</visual>")
    .replace(
        "</robot>",
        '<joint name="j" type="revolute"><parent link="a"/><child link="b"/>'
        '<limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>',
    )
)


def theirs(path: Path) -> list[str]:
    """Everything that it says of a file, hints included."""
    from urdf_validator_main.checks.schema import run as check
    from urdf_validator_main.parser.urdf_adapter import ParseError, load_urdf
    from urdf_validator_main.report.models import ValidationReport

    parsed = load_urdf(str(path))
    if isinstance(parsed, ParseError):
        return [str(parsed)]
    report = ValidationReport(urdf_path=str(path))
    check(parsed, report)
    return [*report.schema.critical_issues, *report.schema.warnings, *report.schema.infos]


def test_what_it_finds_is_found_and_more(tmp_path: Path) -> None:
    (tmp_path / "m.obj").write_text("v 0 0 0\n")
    cases = {name: text for name, (text, _) in BROKEN.items()} | MORE
    found: dict[str, tuple[bool, bool]] = {}
    for number, (name, text) in enumerate(sorted(cases.items())):
        path = tmp_path / f"{number}.urdf"
        path.write_text(text, encoding="utf-8")
        found[name] = (bool(check_urdf(path)), bool(theirs(path)))
    assert [name for name, (ours, other) in found.items() if other and not ours] == []
    assert all(ours for ours, _ in found.values())
    missed = [name for name, (_, other) in found.items() if not other]
    assert {"NaN origin", "zero axis", "triangle inequality", "entities"} <= set(missed), (
        "it has learned; say so in docs"
    )


def test_a_door_that_nothing_touches_is_advice(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "touchless.urdf"
    path.write_text(TOUCHLESS)
    assert any("no collision" in finding for finding in theirs(path))
    assert check_urdf(path) == [] and [found.kind for found in advice(path)] == ["no_collision"]
    assert run(["urdf", "check", str(path)]) == 0
    said = capfd.readouterr().out.splitlines()
    assert said[0].endswith(": sound") and "advice: link 'b'" in said[1]
