"""Trials become numbers, tables and figures: analytic curves whose numbers are known."""

import errno
import io
import json
import warnings
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from numpy.typing import NDArray
from PIL import Image

import proxcgal as px
from proxcgal.core import files
from proxcgal.evaluation import metrics
from proxcgal.evaluation.coverage import Coverage
from proxcgal.study.plotting import CONTROLLER_COLOURS, png
from proxcgal.study.time_figure import time_figure

HZ = 100


def make_log(controller: str = "wb", end: float = 0.25, **changes: Any) -> Any:
    """A trial whose true distance falls straight from 0.5 m to `end` in 2 s and stays."""
    time = np.arange(0.0, 6.0, 1.0 / HZ)
    true = np.maximum(end, 0.5 - (0.5 - end) * time / 2.0)
    seen = np.where(time < 0.5, np.inf, true + 0.01)
    link = np.where(time < 0.5, "", np.where(time < 3.0, "forearm_link", "wrist_3_link"))
    log = SimpleNamespace(
        scenario="front_plane",
        robot="ur10e",
        controller=controller,
        seed=3,
        wall_s=1.0,
        time=time,
        true_m=true,
        seen_m=seen,
        activation=np.clip((0.3 - true) / 0.1, 0.0, 1.0),
        control_link=list(link),
        mode=np.zeros(len(time), int),
        own_m=0.12,
        coverage=Coverage(0.5, 0.25, 0.25, 0.0),
    )
    for name, value in changes.items():
        setattr(log, name, value)

    def summary() -> dict[str, float | int]:
        return {
            "true_min_m": log.true_m.min(),
            "true_final_m": log.true_m[-2 * HZ :].mean(),
            "seen_min_m": log.seen_m.min(),
            "goal_error_m": np.float64(0.4),
            "violations": np.int64((log.true_m < 0.05).sum()),
            "self_min_m": log.own_m,
        }

    log.summary = summary
    return log


@pytest.fixture
def both() -> list[Any]:
    return [make_log("wb", 0.25), make_log("sm", 0.03)]


def test_summary_has_the_keys_that_the_experiments_ask_for(both: list[Any]) -> None:
    summary = metrics.static_summary(both)
    assert list(summary) == [
        "scenario", "robot", "seed", "controllers", "closest_points", "gain_mm", "self_min_m",
        "failed",
    ]  # fmt: skip
    assert list(summary["controllers"]) == list(summary["closest_points"]) == ["wb", "sm"]
    assert tuple(summary["closest_points"]["wb"]) == metrics.COVERAGE_KEYS
    for numbers in summary["controllers"].values():
        assert list(numbers) == [
            "true_min_m", "true_final_m", "seen_min_m", "goal_error_m", "violations", "self_min_m",
        ]  # fmt: skip


def test_gain_is_wb_over_sm_at_the_end_in_millimetres(both: list[Any]) -> None:
    assert metrics.static_summary(both)["gain_mm"] == pytest.approx(220.0)


def test_gain_is_null_where_one_of_the_two_did_not_run() -> None:
    assert metrics.static_summary([make_log("wb")])["gain_mm"] is None


def test_ticks_under_50_mm_are_violations(both: list[Any]) -> None:
    controllers = metrics.static_summary(both)["controllers"]
    # 0.5 - 0.235 t < 0.05 from t = 1.915 s on
    assert controllers["sm"]["violations"] == 600 - 192
    assert controllers["wb"]["violations"] == 0


def test_a_distance_to_nothing_is_written_as_9_99() -> None:
    nothing = np.full(600, np.inf)
    numbers = metrics.static_summary([make_log(seen_m=nothing)])["controllers"]["wb"]
    assert numbers["seen_min_m"] == 9.99


def test_a_gain_over_nothing_is_no_gain(both: list[Any]) -> None:
    both[0].true_m = np.full(600, np.inf)
    assert metrics.static_summary(both)["gain_mm"] is None


def test_what_does_not_apply_is_null_and_the_json_is_strict(tmp_path: Path) -> None:
    summary = metrics.static_summary([make_log(own_m=float("nan"))])
    files.write_json(tmp_path / "summary.json", summary)
    text = (tmp_path / "summary.json").read_text()
    assert json.loads(text)["self_min_m"] is None
    assert "NaN" not in text
    assert "Infinity" not in text


def test_numbers_survive_the_file_exactly(tmp_path: Path, both: list[Any]) -> None:
    summary = metrics.static_summary(both)
    files.write_json(tmp_path / "summary.json", summary)
    assert json.loads((tmp_path / "summary.json").read_text()) == summary


def test_a_number_that_json_cannot_hold_leaves_the_old_file_whole(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    files.write_json(path, {"a": 1})
    with pytest.raises(ValueError, match="JSON"):
        files.write_json(path, {"a": float("nan")})
    assert json.loads(path.read_text()) == {"a": 1}
    assert [p.name for p in tmp_path.iterdir()] == ["summary.json"]


@pytest.mark.parametrize(("own", "failed"), [(0.019, True), (0.02, False)])
def test_a_run_nearer_than_20_mm_to_itself_has_failed(own: float, failed: bool) -> None:
    summary = metrics.static_summary([make_log("wb"), make_log("sm", own_m=own)])
    assert summary["self_min_m"] == own
    assert summary["failed"] is failed


@pytest.mark.parametrize("field", ["scenario", "robot", "seed"])
def test_trials_of_different_kinds_are_not_summed_up(field: str) -> None:
    with pytest.raises(px.ConfigError, match=field):
        metrics.static_summary([make_log("wb"), make_log("sm", **{field: 99})])


def test_a_controller_twice_or_no_trial_at_all_is_refused() -> None:
    with pytest.raises(px.ConfigError, match="wb, wb"):
        metrics.static_summary([make_log("wb"), make_log("wb")])
    with pytest.raises(px.ConfigError, match="at least one"):
        metrics.static_summary([])


def test_combined_keeps_every_scenario_and_the_worst_of_all(both: list[Any]) -> None:
    front = metrics.static_summary(both)
    side = metrics.static_summary([make_log(scenario="side_plane", own_m=0.01)])
    whole = metrics.combined([front, side])
    assert whole["scenarios"] == {"front_plane": front, "side_plane": side}
    assert whole["self_min_m"] == 0.01
    assert whole["failed"] is True


def test_the_table_has_a_line_a_trial_and_the_gain_beside_wb(both: list[Any]) -> None:
    lines = metrics.table([metrics.static_summary(both)]).splitlines()
    assert len(lines) == 2 + 1 + 2
    wb = next(line for line in lines if " wb " in line)
    assert wb.split() == ["front_plane", "wb", "0.250", "0.250", "0.260", "0.400", "0", "+220"]


def test_the_table_counts_violations_where_there_are_any(both: list[Any]) -> None:
    assert "violations" not in metrics.table([metrics.static_summary(both[:1])])
    summary = metrics.static_summary(both)
    lines = metrics.table([summary]).splitlines()
    assert "violations" in lines[0]
    told = str(summary["controllers"]["sm"]["violations"])
    assert next(line for line in lines if " sm " in line).split()[-1] == told != "0"


def test_a_links_colour_is_the_same_in_every_run() -> None:
    links = ["base", "elbow", "wrist"]

    def colours(*held: str) -> dict[str, Any]:
        log = make_log(control_link=[held[0]] * 300 + [held[-1]] * 300)
        figure = time_figure([log], title="", d_min=0.2, buffer=0.1, links=links)
        found = [patch.get_facecolor() for patch in figure.axes[2].patches]
        found += [each.get_facecolor()[0] for each in figure.axes[2].collections]
        return dict(zip(held, map(tuple, found), strict=False))

    one, other = colours("elbow", "wrist"), colours("wrist", "base")
    assert one["wrist"] == other["wrist"]
    assert len({*one.values(), *other.values()}) == 3


def test_modes_and_faults_are_drawn_with_a_legend_where_there_are_any() -> None:
    calm, held = make_log(), make_log(mode=np.r_[np.zeros(300, int), np.full(300, 2)])
    plain = time_figure([calm], title="", d_min=0.2, buffer=0.1)
    assert len(plain.axes) == 3
    figure = time_figure([held], title="", d_min=0.2, buffer=0.1, faults=[(2.5, 4.0)])
    assert figure.axes[3].get_ylabel() == "mode"
    (legend,) = [each for each in figure.axes[0].artists if isinstance(each, Legend)]
    assert [text.get_text() for text in legend.get_texts()] == ["HOLD", "fault"]


def test_figures_of_short_runs_print_no_notes_of_their_layout() -> None:
    figure = Figure(figsize=(0.4, 0.4), layout="constrained")
    figure.subplots().set_ylabel("a label that is longer than the figure is high")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        png(figure)


def pixels(figure: Any) -> NDArray[np.uint8]:
    return np.asarray(Image.open(io.BytesIO(png(figure))).convert("RGB"))


def test_the_figure_over_time_shows_both_controllers_in_their_colours(both: list[Any]) -> None:
    figure = time_figure(both, title="front_plane", d_min=0.2, buffer=0.1)
    image = pixels(figure)
    for name in ("wb", "sm"):
        colour = [int(CONTROLLER_COLOURS[name][i : i + 2], 16) for i in (1, 3, 5)]
        assert (np.abs(image.astype(int) - colour).max(axis=2) < 8).sum() > 1000


def test_every_axis_of_the_figure_over_time_has_a_unit(both: list[Any]) -> None:
    figure = time_figure(both, title="", d_min=0.2, buffer=0.1)
    assert figure.axes[0].get_ylabel() == "minimum distance [m]"
    assert figure.axes[1].get_ylabel() == "activation [-]"
    assert figure.axes[-1].get_xlabel() == "time [s]"


def test_a_distance_to_nothing_is_a_gap_in_the_curve() -> None:
    log = make_log()
    figure = time_figure([log], title="", d_min=0.2, buffer=0.1)
    seen = next(line for line in figure.axes[0].lines if len(line.get_xdata()) == len(log.time))
    assert np.isnan(seen.get_ydata()[:50]).all()
    assert np.isfinite(seen.get_ydata()[50:]).all()


def test_the_same_figure_is_the_same_file(both: list[Any]) -> None:
    files = {png(time_figure(both, title="", d_min=0.2, buffer=0.1)) for _ in range(2)}
    assert len(files) == 1


def test_a_full_disk_is_told_with_the_file_that_had_no_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space left") as caught:
        files.write_json(tmp_path / "summary.json", {})
    assert caught.value.filename == str(tmp_path / "summary.json")
    assert list(tmp_path.iterdir()) == []
