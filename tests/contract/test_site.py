"""The docs as a site: every page has its place, every link leads somewhere, tables come from declarations."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from scenewright.schemas.kinds import KINDS
from scenewright.stages.engine.discovery import all_stages

from docs.reference import pages, version

ROOT = Path(__file__).resolve().parents[2]


def test_generated_pages_have_every_step_option_and_kind() -> None:
    made = pages()
    for stage in all_stages().values():
        section = made["reference/commands.md"].split(f"\n## {stage.name}\n")[1].split("\n## ")[0]
        for name in stage.parameters.model_fields:
            assert f"`--{name.replace('_', '-')}`" in section, (stage.name, name)
        for role in stage.reads:
            assert f"`--{role.replace('_', '-')}`" in section, (stage.name, role)
    assert set(re.findall(r"^## (\S+)$", made["reference/kinds.md"], re.MULTILINE)) == set(KINDS)
    pipelines = {path.stem for path in (ROOT / "data" / "pipelines").glob("*.toml")}
    assert set(re.findall(r"^## (\S+)$", made["reference/pipelines.md"], re.MULTILINE)) == pipelines


def test_the_site_builds_with_strict_links(tmp_path: Path) -> None:
    pytest.importorskip("material", reason="needs mkdocs-material")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--site-dir", tmp_path / "site"],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    html = (tmp_path / "site" / "index.html").read_text()
    assert "LOGS.html" in html
    assert f"scenewright {version()}" in html
    assert (tmp_path / "site" / "search" / "search_index.json").exists()
    fetched = re.findall(r'(?:<script[^>]+src|<link[^>]+rel="stylesheet"[^>]+href)="(https?://[^"]+)"', html)
    assert fetched == [], "the site works without a network"
