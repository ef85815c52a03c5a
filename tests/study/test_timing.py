"""The timing grid: its inputs are what the controller meets, its numbers what was measured."""

import csv
import functools
import json
import shutil
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import proxcgal as px
from proxcgal.cli import main
from proxcgal.scenario.loading import load_scenario
from proxcgal.study.timing import grid as timing_grid
from proxcgal.study.timing.comparison import compare, cycle_verdict, sweep_table
from proxcgal.study.timing.grid import Effort, TimingCell, measure, sweep_summary, time_cells
from proxcgal.study.timing.inputs import Inputs, grid_inputs

EFFORT = Effort(seconds=0.0, rounds=3, most=3)
CELL_KEYS = [
    "robot", "vertices", "cloud", "points", "algorithm", "method", "median_us", "p99_us", "max_us",
]  # fmt: skip


@pytest.fixture(scope="module")
def grid(arm_cell: Path) -> list[Inputs]:
    return list(grid_inputs(load_scenario(arm_cell), [100, 200], ["raw", "1m"]))


@pytest.fixture(scope="module")
def cells(grid: list[Inputs]) -> list[TimingCell]:
    return list(time_cells(grid, EFFORT))


def test_the_clouds_do_not_depend_on_the_meshes_that_are_timed(grid: list[Inputs]) -> None:
    coarse, fine = (
        next(i for i in grid if i.vertices == v and i.cloud == "1m") for v in (100, 200)
    )
    np.testing.assert_array_equal(coarse.environment_W, fine.environment_W)
    counts = [len(fine.robot.mesh(link)[0]) for link in fine.robot.link_names]
    assert counts == pytest.approx([200] * 3, rel=0.1)


# --- Measuring


def test_calls_take_turns_and_each_turn_begins_with_one_that_warms_up() -> None:
    made: list[str] = []
    calls = {name: functools.partial(made.append, name) for name in "ab"}
    samples = measure(calls, Effort(seconds=10.0, rounds=2, most=4))
    assert "".join(made) == "aaabbb" * 2
    assert {name: len(times) for name, times in samples.items()} == {"a": 4, "b": 4}
    assert all((times > 0.0).all() for times in samples.values())


def test_a_slow_call_is_still_timed_in_every_round() -> None:
    (samples,) = measure({"slow": lambda: None}, Effort(seconds=0.0, rounds=5, most=99)).values()
    assert len(samples) == 5


def test_a_grid_has_both_algorithms_by_both_methods(
    grid: list[Inputs], cells: list[TimingCell]
) -> None:
    assert len(cells) == 4 * len(grid)
    assert {(c.algorithm, c.method) for c in cells} == {
        (1, "paper"), (1, "fast"), (2, "paper"), (2, "fast"),
    }  # fmt: skip
    first = grid[0]
    sizes = {1: len(first.points_W), 2: len(first.environment_W)}
    assert all(c.points == sizes[c.algorithm] for c in cells[:4])


def test_methods_that_disagree_are_not_timed(
    grid: list[Inputs], monkeypatch: pytest.MonkeyPatch
) -> None:
    right = timing_grid.call_of

    def wrong(inputs: Inputs, algorithm: int, method: str) -> Callable[[], Any]:
        if (algorithm, method) == (1, "fast"):
            return lambda: np.zeros(len(inputs.points_W), bool)
        return right(inputs, algorithm, method)

    monkeypatch.setattr(timing_grid, "call_of", wrong)
    with pytest.raises(px.SimulationError, match=r"100 vertices, cloud raw: .*Algorithm 1"):
        next(time_cells(grid, EFFORT))


# --- Numbers


def test_the_summary_has_the_keys_that_were_promised(cells: list[TimingCell]) -> None:
    summary = sweep_summary(cells, "a machine")
    assert list(summary) == ["machine", "cells", "growth"]
    for cell in summary["cells"]:
        assert list(cell) == CELL_KEYS
        assert 0.0 < cell["median_us"] <= cell["p99_us"] <= cell["max_us"]
    assert len(summary["growth"]) == 4
    for row in summary["growth"]:
        assert set(row) == {"robot", "algorithm", "method", "vertices", "points"}
        assert set(row["points"]) == {"exponent", "low", "high", "formula"}
    json.dumps(summary, allow_nan=False)


def pair_of(robot: str, algorithm: int, paper: float, fast: float) -> list[dict[str, Any]]:
    same = {"robot": robot, "vertices": 100, "cloud": "raw", "points": 9, "algorithm": algorithm}
    return [
        {**same, "method": "paper", "median_us": paper},
        {**same, "method": "fast", "median_us": fast},
    ]


def test_the_table_has_a_line_a_pair_with_its_ratio() -> None:
    pairs = compare(pair_of("r", 1, 100.0, 8.0) + pair_of("r", 2, 9000.0, 3.0))
    lines = sweep_table(pairs).splitlines()
    assert len(lines) == 5
    assert lines[3].split() == ["r", "raw", "100", "9", "1", "100", "8.0", "12.5"]
    assert lines[4].split()[-1] == "3000.0"


def test_the_verdict_names_where_both_algorithms_together_miss_the_cycle() -> None:
    fits = pair_of("quick", 1, 100.0, 1.0) + pair_of("quick", 2, 66_000.0, 1.0)
    misses = pair_of("slow", 1, 1000.0, 1.0) + pair_of("slow", 2, 66_000.0, 1.0)
    assert "stays within" in cycle_verdict(compare(fits))
    told = cycle_verdict(compare(fits + misses))
    assert (
        "misses the paper's 66.7 ms in 1 of 2 cells: slow, 100 vertices, raw cloud: 67 ms" in told
    )


# --- The command


@pytest.fixture(scope="module")
def written(arm_cell: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A quick grid of the small arm, and what the command said."""
    folder = tmp_path_factory.mktemp("grid") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("proxcgal.study.timing.sweep.QUICK", EFFORT)
        said: list[str] = []
        patch.setattr("builtins.print", lambda *words, **_: said.append(" ".join(map(str, words))))
        command = ["sweep", "--quick", "--scenario", str(arm_cell), "--out", str(folder)]
        assert main.main([*command, "--quiet"]) == 0
    return folder, "\n".join(said)


def test_the_command_writes_what_it_promises(written: tuple[Path, str]) -> None:
    folder, said = written
    assert {path.name for path in folder.iterdir()} == {
        "summary.json", "run.json", "samples.csv", "cell.toml", "algorithm1.png", "algorithm2.png",
        "clouds_arm.png", "report.html",
    }  # fmt: skip
    assert said.splitlines()[-1] == str(folder / "report.html")
    summary = json.loads((folder / "summary.json").read_text())
    assert {(c["vertices"], c["cloud"]) for c in summary["cells"]} == {
        (vertices, cloud) for vertices in (100, 1000, 10000) for cloud in ("raw", "1m")
    }
    assert "66.7 ms" in said


def test_every_single_time_is_kept(written: tuple[Path, str]) -> None:
    folder, _ = written
    with (folder / "samples.csv").open() as file:
        rows = list(csv.DictReader(file))
    (cell,) = (
        c for c in json.loads((folder / "summary.json").read_text())["cells"]
        if [c[key] for key in CELL_KEYS[1:6] if key != "points"] == [1000, "raw", 2, "fast"]
    )  # fmt: skip
    own = [
        float(row["time_us"]) for row in rows
        if (row["vertices"], row["cloud"], row["algorithm"], row["method"])
        == ("1000", "raw", "2", "fast")
    ]  # fmt: skip
    assert len(own) == EFFORT.rounds
    assert np.median(own) == pytest.approx(cell["median_us"], abs=0.001)


class Text(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)

    def handle_data(self, data: str) -> None:
        self.text += data


def page_of(folder: Path) -> Text:
    page = Text()
    page.feed((folder / "report.html").read_text())
    return page


def test_the_report_shows_times_growth_and_figures(written: tuple[Path, str]) -> None:
    page = page_of(written[0])
    assert page.tags.count("img") == 3
    for fact in ("Algorithm 2", "Growth", "formula", "66.7 ms", "samples.csv", "arm", "10000"):
        assert fact in page.text


def test_a_report_is_made_again_from_the_summary_alone(
    written: tuple[Path, str], tmp_path: Path
) -> None:
    summary = json.loads((written[0] / "summary.json").read_text())
    summary["growth"] = []
    for cell in summary["cells"]:
        cell["robot"] = "<script>/../x"
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    assert main.main(["report", str(tmp_path)]) == 0
    page = page_of(tmp_path)
    assert "script" not in page.tags
    assert "<script>/../x" in page.text


def test_a_damaged_summary_is_told_with_its_key(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "summary.json").write_text('{"machine": "m", "cells": [{"robot": "r"}]}')
    assert main.main(["report", str(tmp_path)]) == 2
    assert "cells.0.vertices" in capsys.readouterr().err
    assert not (tmp_path / "report.html").exists()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--scenario", "no_such_cell"], ["no_such_cell", "timing_ur10e"]),
        (["--scenario", "cell.toml", "cell.toml"], ["arm, arm", "one scenario for each robot"]),
        (["--scenario"], ["none", "one scenario for each robot"]),
        (["--scenario", "far.toml"], ["'1m'", "no point"]),
        (["--scenario", "cell.toml", "--out", "arm.urdf/x"], ["--out arm.urdf/x"]),
        (["--slow"], ["--slow"]),
    ],
)
def test_bad_input_is_exit_2_and_writes_nothing(
    arm_cell: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str], arguments: list[str], told: list[str],
) -> None:  # fmt: skip
    for file in arm_cell.parent.iterdir():
        shutil.copy(file, tmp_path)
    far = arm_cell.read_text().replace("[0.6, 0.0, 0.5]", "[1.6, 0.0, 0.5]")
    (tmp_path / "far.toml").write_text(far)
    monkeypatch.chdir(tmp_path)
    assert main.main(["sweep", "--quick", "--quiet", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "Traceback" not in captured.err
    for word in told:
        assert word in captured.err
    assert {path.name for path in tmp_path.iterdir()} == {"arm.urdf", "cell.toml", "far.toml"}


def test_an_interrupted_grid_leaves_nothing(
    arm_cell: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(timing_grid, "measure", interrupt)
    out = tmp_path / "out"
    command = ["sweep", "--quick", "--quiet", "--scenario", str(arm_cell), "--out", str(out)]
    assert main.main(command) == 130
    assert "nothing was kept" in capsys.readouterr().err
    assert not out.exists()
