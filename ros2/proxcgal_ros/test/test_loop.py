"""The whole loop over ROS 2: what it does to the experiment of front_plane."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from proxcgal_msgs.msg import Proximity
from proxcgal_ros.source import OVERDUE

from conftest import PATIENT, Client, Processes, goal
from proxcgal.recording.reader import read_recording
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.setup import Setup
from proxcgal.trial.trial import run_trial

SCENE = "front_plane"
LONG = "duration=24.0"  # twice the scene's: time that a busy machine loses has been made up by then
CLOCK = 2.5e-6  # [s] that the controller's clock of whole microseconds may add to a step


@pytest.fixture
def setup() -> Setup:
    return Setup.of(load_scenario(SCENE, [LONG]))


def over_ros(
    controller: str, setup: Setup, folder: Path, processes: Processes, client: Client
) -> dict[str, float]:
    """The scene's summary, its goal sent as one of MoveRobot."""
    out = folder / f"{controller}.json"
    node, sim = f"node_{controller}", f"sim_{controller}"
    record = folder / f"{controller}.mcap"
    processes.start(
        node, "node", *PATIENT, "-p", f"controller:={controller}", "-p", f"record:={record}"
    )
    arm = processes.start(sim, "sim", SCENE, "--set", LONG, "--out", str(out))
    heard = client.listen(Proximity, "proximity")
    heard.clear()
    assert client.until(lambda: heard and heard[-1][1].mode == Proximity.RUN)
    x, y, z = setup.goal[:3, 3].tolist()
    handle = client.send(goal(x, y, z, frame="kuka_base"))
    assert handle.accepted
    assert client.until(lambda: arm.poll() is not None)
    assert (processes.end(sim), processes.end(node)) == (0, 0)
    told: dict[str, float] = json.loads(out.read_text())
    return told


def test_front_plane_over_ros_keeps_the_gain_of_the_direct_loop(
    setup: Setup, tmp_path: Path, processes: Processes, client: Client
) -> None:
    names = ("wb", "sm")
    direct = {
        name: run_trial(setup.scenario, name, robot=setup.robot, sparse_truth=True).summary()
        for name in names
    }
    ros = {name: over_ros(name, setup, tmp_path, processes, client) for name in names}
    gains = [
        1000.0 * (told["wb"]["true_final_m"] - told["sm"]["true_final_m"]) for told in (direct, ros)
    ]
    print(f"gain: direct {gains[0]:.1f} mm, over ROS 2 {gains[1]:.1f} mm")
    print({name: told["true_min_m"] for name, told in ros.items()})
    assert gains[1] == pytest.approx(gains[0], abs=20.0)

    # Velocities changed by no more than the time that had passed allows, also where scans came
    # between two joint states and made a tick of their own. How many do is the machine's affair
    # (test_source.py scripts them).
    ticks = read_recording(tmp_path / "wb.mcap").ticks
    times = np.array([tick.inputs.time for tick in ticks])
    stamps = np.array([tick.inputs.q_stamp for tick in ticks])
    early = np.flatnonzero(np.diff(stamps) == 0.0) + 1
    commands = np.array([tick.result.qd for tick in ticks])
    period = 1.0 / setup.scenario.simulation.control_hz
    passed = np.diff(times) + CLOCK
    most = passed[:, None] * np.asarray(setup.robot.qdd_max)
    assert np.all(np.abs(np.diff(commands, axis=0)) <= most * (1.0 + 1e-5))
    # The arm was carried on by what its joint state told: the velocity of a command before it.
    # Which one is the machine's affair too.
    q = np.array([tick.inputs.q for tick in ticks])
    for row in early:
        of_state = np.flatnonzero(stamps[:row] == stamps[row])[0]  # its own tick
        ahead = min(times[row] - stamps[row], OVERDUE * period)
        if ahead < 1e-4 or np.array_equal(q[row], q[of_state]):
            continue
        v = (q[row] - q[of_state]) / ahead
        before = np.vstack([commands[:row], np.zeros_like(v)])
        assert np.abs(before - v).max(axis=1).min() < 1e-6
