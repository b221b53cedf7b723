"""Options of every test run."""

from __future__ import annotations

import zlib

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slice", default="", metavar="K/N", help="of the tests, those of slice K (0, 1, ...) of N")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave the tests of the slice, drawn by their names so that a new test moves no other."""
    if not config.option.slice:
        return
    number, count = (int(part) for part in config.option.slice.split("/"))
    left_out = [item for item in items if zlib.crc32(item.nodeid.encode()) % count != number % count]
    items[:] = [item for item in items if item not in set(left_out)]
    config.hook.pytest_deselected(items=left_out)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Say which order it was, also where the header is not shown."""
    seed = getattr(config.option, "randomly_seed", None)
    if seed is not None:
        terminalreporter.write_line(f"order of --randomly-seed={seed}")
