"""Two libraries have no package for Linux on ARM: what needs them says so by name, and the rest works."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from scenewright.schemas.errors import MissingDependency

REPOSITORY = Path(__file__).resolve().parents[2]
WITHOUT = "import sys; sys.modules['pycolmap'] = sys.modules['embreex'] = None; "


def test_what_needs_it_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    from scenewright.stages.splat.triangulation import with_points

    monkeypatch.setitem(sys.modules, "pycolmap", None)
    with pytest.raises(MissingDependency, match="pycolmap cannot be imported, which triangulation needs"):
        with_points([], 0)


def test_rays_meet_meshes_without_it() -> None:
    files = ["tests/unit/plan/test_regions.py", "tests/unit/motion/test_doors_and_grasps.py"]
    code = f"{WITHOUT}import pytest; sys.exit(pytest.main({files!r}))"
    settings = {**os.environ, "OMP_NUM_THREADS": "1", "PYTEST_ADDOPTS": ""}
    done = subprocess.run([sys.executable, "-c", code], cwd=REPOSITORY, env=settings, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
