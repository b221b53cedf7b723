"""Where the real logs are: the folder that SCENEWRIGHT_DATA names, else ../shared/data beside the repository."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(os.environ.get("SCENEWRIGHT_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))


def real_data(name: str) -> Path:
    """Return the folder of a real data set, or skip the test with the reason."""
    folder = ROOT / name
    if not folder.exists():
        pytest.skip(f"real data {name!r} is not here (set SCENEWRIGHT_DATA to the folder that holds it)")
    return folder
