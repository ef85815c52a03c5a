"""What `import proxcgal` brings, and when."""

import subprocess
import sys

import pytest

import proxcgal as px


@pytest.mark.parametrize("library", ["pydantic", "mujoco", "trimesh", "pinocchio"])
def test_importing_the_package_loads_no_slow_library(library: str) -> None:
    code = f"import sys, proxcgal; sys.exit({library!r} in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("name", px.__all__)
def test_every_public_name_is_there(name: str) -> None:
    assert getattr(px, name).__module__.startswith("proxcgal")


def test_a_name_that_is_not_public_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="'proxcgal' has no attribute 'nothing'"):
        px.nothing  # noqa: B018  # type: ignore[attr-defined]


def test_a_scenario_runs_by_public_names_alone() -> None:
    scenario = px.load_scenario("front_plane", ["duration=0.1"])
    assert scenario.robot in px.list_robots()
    assert px.run_trial(scenario, "wb", without_truth=True).controller == "wb"
