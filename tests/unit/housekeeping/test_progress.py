"""How progress is shown."""

from __future__ import annotations

import pytest
from scenewright.stages.kit.progress import BarProgress, LineProgress, SilentProgress, progress_for


def test_a_terminal_has_bars_and_a_pipe_has_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MAKEFLAGS", raising=False)
    assert isinstance(progress_for(True), BarProgress)
    assert isinstance(progress_for(False), LineProgress)
    assert type(progress_for(True, quiet=True)) is SilentProgress


def test_steps_that_run_beside_others_have_lines_with_their_names(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("MAKEFLAGS", " -j2 --jobserver-auth=3,4 --no-print-directory")
    progress = progress_for(True, name="geometric_map")
    with progress.step("integrate frames"):
        assert list(progress.track([1, 2], description="frames")) == [1, 2]
    assert capsys.readouterr().err == "geometric_map: integrate frames ...\n"
