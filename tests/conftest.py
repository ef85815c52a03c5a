"""What every test may use: markers and the options behind them."""

from pathlib import Path

import pytest

SHARED_ROBOTS = Path(__file__).parents[2] / "shared" / "robots"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--long", action="store_true", help="run the long forms of the tests too")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not SHARED_ROBOTS.is_dir():
        skip = pytest.mark.skip(reason="needs ../shared/robots, which is not here")
        for item in items:
            if item.get_closest_marker("shared"):
                item.add_marker(skip)
    # A test named on the command line, or chosen by -m, is wanted whatever its length.
    named = any("::" in argument for argument in config.args)
    if config.getoption("long") or named or "long" in config.getoption("markexpr"):
        return
    long = [item for item in items if item.get_closest_marker("long")]
    if long:
        items[:] = [item for item in items if item not in long]
        config.hook.pytest_deselected(items=long)
        config.stash[_LEFT_OUT] = len(long)


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    if left_out := config.stash.get(_LEFT_OUT, 0):
        terminalreporter.write_line(f"{left_out} long tests left out; with them: ./run test --long")


@pytest.fixture(scope="session")
def shared_robots() -> Path:
    """The folder of robot descriptions that play a user's own; only for tests marked `shared`."""
    return SHARED_ROBOTS


_LEFT_OUT = pytest.StashKey[int]()
