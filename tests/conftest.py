"""What every test may use: markers and the options behind them."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from browser import Tab, chromium

import proxcgal as px
from proxcgal.cli import main
from proxcgal.study.campaign import Campaign, CampaignRequest
from proxcgal.study.static import campaign as static_campaign

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


@pytest.fixture(scope="session")
def ur10e() -> px.Robot:
    """The built-in robot as the controller takes it; its full meshes come with it."""
    return px.load_robot("ur10e")


class Answer(NamedTuple):
    """What a command gave."""

    code: int
    out: str
    err: str


@pytest.fixture
def call(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., Answer]:
    """Runs a command in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str | Path) -> Answer:
        code = main.main([str(argument) for argument in arguments])
        return Answer(code, *capsys.readouterr())

    return run


@pytest.fixture(scope="session")
def planned() -> Campaign:
    """A small campaign: two draws of 0.2 s round one scene, four controllers each."""
    return static_campaign.plan(
        CampaignRequest(runs=2, seed=0, scenarios=("front_plane",), overrides=("duration=0.2",))
    )


@pytest.fixture(scope="session")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of that campaign after it ran in one process, uninterrupted."""
    folder = tmp_path_factory.mktemp("campaign") / "whole"
    arguments = [
        "campaign", "static", "--scenario", "front_plane", "--runs", "2", "--set", "duration=0.2",
        "--workers", "1", "--keep", "worst:1", "--quiet", "--out", str(folder),
    ]  # fmt: skip
    assert main.main(arguments) == 0
    return folder


@pytest.fixture(scope="session")
def arm_cell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scenario file, `cell.toml`, of a small arm that stands still beside a panel."""
    folder = tmp_path_factory.mktemp("cell")
    (folder / "arm.urdf").write_text(_ARM)
    (folder / "cell.toml").write_text(_CELL)
    return folder / "cell.toml"


@pytest.fixture(scope="session")
def open_tab() -> Iterator[Callable[[], Tab]]:
    """Opens a tab of a real browser; skipped where there is none."""
    with chromium() as opened:
        yield opened


_LEFT_OUT = pytest.StashKey[int]()

# Small meshes, so that no test waits for their decimation.
_ARM = """<?xml version="1.0"?><robot name="arm">
<link name="base_link"><visual><geometry><box size="0.2 0.2 0.1"/></geometry></visual></link>
<link name="upper"><visual><origin xyz="0 0 0.25"/>
  <geometry><cylinder radius="0.05" length="0.5"/></geometry></visual></link>
<link name="hand"><visual><geometry><sphere radius="0.08"/></geometry></visual></link>
<joint name="turn" type="revolute"><parent link="base_link"/><child link="upper"/>
  <axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
<joint name="bend" type="revolute"><parent link="upper"/><child link="hand"/>
  <origin xyz="0 0 0.65"/><axis xyz="0 1 0"/>
  <limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
</robot>"""

_CELL = """
kind = "static"
robot = "arm.urdf"
q0 = [0.1, 0.2]
duration = 1.0
[goal]
offset = [0.0, 0.0, 0.0]
[[skin.rings]]
link = "upper"
at = [0.3, 0.9]
sensors = 6
[skin.sensor]
workspace = 6.0
[[obstacle]]
name = "panel"
size = [0.02, 0.8, 0.8]
position = [0.6, 0.0, 0.5]
[[obstacle]]
name = "wall"
size = [0.1, 4.0, 3.0]
position = [-1.7, 0.0, 0.5]
"""
