import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

HELPERS = """from scenewright.stages.kit.compiled import compiled
OFFSET = {offset}
@compiled
def helped(value):
    return value * {factor} + OFFSET
"""
MIDDLE = """from helpers import helped
from scenewright.stages.kit.compiled import compiled
@compiled
def between(value):
    return helped(value)
"""
CALLER = """import json
from middle import between
from settings import LIMIT
from scenewright.stages.kit.compiled import compiled
@compiled
def called(value):
    return min(between(value), LIMIT)
print(json.dumps([called(3.0), sum(called.stats.cache_hits.values())]))
"""


def outcome(folder: Path, factor: float = 2.0, offset: float = 0.0, limit: float = 100.0) -> list[float]:
    """Return what a new process gets of the compiled function, and how often it took what was kept."""
    (folder / "helpers.py").write_text(HELPERS.format(factor=factor, offset=offset))
    (folder / "middle.py").write_text(MIDDLE)
    (folder / "settings.py").write_text(f"LIMIT = {limit}\n")
    (folder / "caller.py").write_text(CALLER)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), *sys.path])}
    done = subprocess.run([sys.executable, folder / "caller.py"], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return list(json.loads(done.stdout))


@pytest.mark.parametrize(
    ("change", "value"),
    [({"factor": 5.0}, 15.0), ({"offset": 1.0}, 7.0), ({"limit": 4.0}, 4.0)],
    ids=["function two files away", "number of another file", "number that is imported"],
)
def test_an_edit_of_another_file_compiles_anew(tmp_path: Path, change: dict[str, float], value: float) -> None:
    assert outcome(tmp_path) == [6.0, 0]
    assert outcome(tmp_path) == [6.0, 1]
    assert outcome(tmp_path, **change) == [value, 0]


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
def test_kept_code_that_is_torn_is_compiled_anew(tmp_path: Path, kind: str) -> None:
    outcome(tmp_path)
    kept = list((tmp_path / "__pycache__").glob(f"*.{kind}"))
    for file in kept:
        file.write_bytes(file.read_bytes()[:-20])
    assert kept and outcome(tmp_path) == [6.0, 0]
    assert outcome(tmp_path) == [6.0, 1]


def test_compilation_is_said_once_and_timed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from numba.core import config
    from scenewright.stages.kit.compiled import compiled
    from scenewright.stages.kit.progress import COMPILE, LineProgress, showing

    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    progress = LineProgress()
    with showing(progress):
        for number in (1, 2.0):
            compiled(lambda value: value + 1)(number)
    assert capsys.readouterr().err.count("compile") == 1
    assert progress.seconds[COMPILE] > 0.0
