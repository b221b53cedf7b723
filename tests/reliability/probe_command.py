"""`python -m tests.reliability.probe_command WORDS`: the command line with the tests' probe as its only step."""

from __future__ import annotations

import importlib

import scenewright.cli.application
from scenewright.cli.main import main
from scenewright.stages.engine import runner

from tests.contract.probe_step import PROBE

_import_module = importlib.import_module


class _Importer:
    """Finds the probe where it lies, outside of stages/."""

    @staticmethod
    def import_module(name: str) -> object:
        return _import_module("tests.contract.probe_step" if name == "scenewright.stages.probe.stage" else name)


if __name__ == "__main__":
    runner.importlib = _Importer  # type: ignore[attr-defined]
    scenewright.cli.application.all_stages = lambda: {"probe": PROBE}  # type: ignore[attr-defined]
    main()
