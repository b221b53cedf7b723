"""What counts as a change of a step's code, and what doesn't."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenewright.stages.engine.code.places import Places
from scenewright.stages.engine.code.program import Code, Definition, Program

FILES = {
    "__init__.py": "",
    "stages/__init__.py": "",
    "stages/bake/__init__.py": "",
    "stages/bake/stage.py": '''
from __future__ import annotations
import importlib
import math as m
from typing import TYPE_CHECKING
from scenewright.stages.bake.oven import heat
from scenewright.stages.kit import clock
if TYPE_CHECKING:
    from scenewright.stages.bake.unused import Cake
PART = "scenewright.stages.bake.parts"

def run(dough, *, parameters, context):
    """Bake."""
    context.logger.info("baking")
    from scenewright.stages.bake.late import crust
    made = m.floor(2.5) + heat(dough) + crust(clock.MINUTES)
    return importlib.import_module(f"{PART}.{parameters.part}").finish(made)
''',
    "stages/bake/oven.py": """
DEGREES = 200
SPARE = 3
TABLE = {}
TABLE["fan"] = 0.9

def heat(dough):
    # hot
    warm = [piece * DEGREES for piece in dough]
    return warm

def unused():
    return SPARE
""",
    "stages/bake/late.py": "def crust(minutes: int) -> int:\n    return minutes // 2\n",
    "stages/bake/unused.py": "class Cake:\n    layers = 3\n",
    "stages/bake/parts/__init__.py": "",
    "stages/bake/parts/icing.py": "SUGAR = 50\n\ndef finish(made):\n    return made + [SUGAR]\n",
    "stages/kit/__init__.py": "",
    "stages/kit/clock.py": "MINUTES = 30\nHOURS = 2\n",
}


def program(folder: Path) -> Program:
    return Program(Places({"scenewright": [folder]}))


def code(tmp_path: Path, **changes: tuple[str, str]) -> Code:
    """Digest the step with a text replaced in some files (`oven=("200", "220")`)."""
    for name, text in FILES.items():
        before, after = changes.pop(Path(name).stem, ("", "")) if Path(name).stem in changes else ("", "")
        assert before in text
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text.replace(before, after) if before else text)
    assert not changes
    return program(tmp_path).code_of([Definition("scenewright.stages.bake.stage", "run")])


@pytest.fixture
def original(tmp_path: Path) -> Code:
    return code(tmp_path / "original")


@pytest.mark.parametrize(
    ("file", "before", "after"),
    [
        ("oven", "= 200", "= 220"),
        ("oven", "piece * DEGREES", "piece + DEGREES"),
        ("oven", '["fan"] = 0.9', '["fan"] = 0.8'),
        ("late", "minutes // 2", "minutes // 3"),
        ("icing", "= 50", "= 60"),
        ("clock", "= 30", "= 31"),
        ("stage", "heat(dough) + crust", "heat(dough) - crust"),
        ("stage", "clock.MINUTES", "clock.HOURS"),
        ("stage", "import math as m", "import numpy as m"),
    ],
)
def test_constants_lines_and_late_imports_count(
    tmp_path: Path, original: Code, file: str, before: str, after: str
) -> None:
    changed = code(tmp_path / "changed", **{file: (before, after)})
    assert changed.digest != original.digest
    (name,) = (
        module
        for module, digest in changed.modules.items()
        if digest != original.modules.get(module) and (not module.endswith("clock") or file != "stage")
    )
    assert name.endswith(file)


@pytest.mark.parametrize(
    ("file", "before", "after"),
    [
        ("stage", '"""Bake."""', '"""Bake it."""'),
        ("stage", '"baking"', '"we bake"'),
        ("stage", "made", "cake"),
        ("stage", "from scenewright.stages.kit import clock", "import scenewright.stages.kit.clock as clock"),
        ("oven", "# hot", "# very hot"),
        ("oven", "SPARE = 3", "SPARE = 4"),
        ("oven", "piece", "slice_of_it"),
        ("oven", "DEGREES", "CELSIUS"),
        ("oven", "warm = [", "warm: list[int] = ["),
        ("late", "minutes: int", "minutes: float"),
        ("unused", "3", "4"),
        ("clock", "HOURS = 2", "HOURS = 3"),
    ],
)
def test_words_names_and_what_is_not_reached_do_not(
    tmp_path: Path, original: Code, file: str, before: str, after: str
) -> None:
    assert code(tmp_path / "changed", **{file: (before, after)}).digest == original.digest


def test_moving_a_definition_changes_nothing(tmp_path: Path, original: Code) -> None:
    code(tmp_path, oven=("DEGREES = 200\n", "from scenewright.stages.kit.heat import DEGREES\n"))
    (tmp_path / "stages/kit/heat.py").write_text("DEGREES = 200\n")
    (tmp_path / "stages/bake/oven.py").rename(tmp_path / "stages/bake/furnace.py")
    stage = tmp_path / "stages/bake/stage.py"
    stage.write_text(stage.read_text().replace("bake.oven", "bake.furnace"))
    assert program(tmp_path).code_of([Definition("scenewright.stages.bake.stage", "run")]).digest == original.digest


def test_what_cannot_be_followed_is_all_of_the_folder(tmp_path: Path) -> None:
    unknown = ('f"{PART}.{parameters.part}"', "parameters.part")
    before, after = code(tmp_path / "a", stage=unknown), code(tmp_path / "b", stage=unknown, unused=("3", "4"))
    assert before.digest != after.digest


def test_who_hands_a_package_to_a_finder_reaches_all_of_it(tmp_path: Path) -> None:
    finder = "def every(package):\n    return importlib.import_module(package)\n"
    found = ('return importlib.import_module(f"{PART}.{parameters.part}").finish(made)', "return every(PART)")
    codes = []
    for name, sugar in (("a", "50"), ("b", "60")):
        code(tmp_path / name, stage=found, icing=("50", sugar))
        stage = tmp_path / name / "stages/bake/stage.py"
        stage.write_text(
            stage.read_text().replace("def run", "from scenewright.stages.kit.finding import every\n\ndef run")
        )
        (tmp_path / name / "stages/kit/finding.py").write_text(f"import importlib\n\n{finder}")
        codes.append(program(tmp_path / name).code_of([Definition("scenewright.stages.bake.stage", "run")]))
    assert codes[0].digest != codes[1].digest and "scenewright.stages.bake.unused" not in codes[0].modules
