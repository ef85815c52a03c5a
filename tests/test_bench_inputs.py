"""Files of inputs for benchmarks: read as their documentation says, they hold what was there."""

import importlib.util
import struct
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import proxcgal as px
from proxcgal.scenario.loading import load_scenario
from proxcgal.study.timing.inputs import Inputs, grid_inputs

SCRIPT = Path(__file__).parents[1] / "bench" / "inputs.py"


@pytest.fixture(scope="module")
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("bench_inputs", SCRIPT)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def inputs(arm_cell: Path) -> Inputs:
    return next(grid_inputs(load_scenario(arm_cell), [100], ["raw"], scans=2))


class Reader:
    """One value after another, as a reader without Python would take them."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = 0

    def array(self, *shape: int, kind: str = "<f8") -> NDArray[Any]:
        found = np.frombuffer(self.data, kind, int(np.prod(shape)), self.at)
        self.at += found.nbytes
        return found.reshape(shape)

    def integer(self) -> int:
        (value,) = struct.unpack_from("<i", self.data, self.at)
        self.at += 4
        return int(value)

    def text(self) -> str:
        size = self.integer()
        return bytes(self.array(size, kind="u1")).decode()


def test_a_file_reads_back_as_documented(script: ModuleType, inputs: Inputs) -> None:
    robot, setup = inputs.robot, inputs.seen.setup
    file = Reader(script.encode(inputs))
    assert bytes(file.array(8, kind="u1")) == b"PXBENCH1"
    assert file.text() == robot.name
    joints = file.integer()
    assert joints == robot.n_q
    for row, name in enumerate(robot.joint_names):
        assert file.text() == name
        assert [file.integer(), file.integer()] == [0, row - 1]
        origin, axis = file.array(4, 4), file.array(3)
        np.testing.assert_array_equal(origin, robot.description.joints[row].origin)
        assert np.linalg.norm(axis) == pytest.approx(1.0)
        limits = file.array(4)
        np.testing.assert_array_equal(
            limits, [robot.q_min[row], robot.q_max[row], robot.qd_max[row], robot.qdd_max[row]]
        )
    assert file.text() == robot.tool
    assert file.integer() == robot.description.tool_frame.joint
    file.array(4, 4)
    links = file.integer()
    for name in robot.link_names[:links]:
        assert file.text() == name
        file.integer()
        file.array(4, 4)
        assert file.array(1)[0] == robot.mesh_error(name)
        vertices_L, triangles = robot.mesh(name)
        np.testing.assert_array_equal(file.array(file.integer(), 3), vertices_L)
        np.testing.assert_array_equal(file.array(file.integer(), 3, kind="<i4"), triangles)
    np.testing.assert_array_equal(file.array(joints), inputs.q)
    np.testing.assert_array_equal(file.array(links, 4, 4), robot.link_poses(inputs.q))
    np.testing.assert_array_equal(file.array(4, 4), setup.goal)
    assert file.array(6)[3] == setup.skin.model.workspace
    assert file.integer() == 0
    for mount in setup.skin.mounts[: file.integer()]:
        assert file.text() == mount.name
        assert robot.link_names[file.integer()] == mount.link
        np.testing.assert_array_equal(file.array(4, 4), mount.T_LS)
    scans = file.integer()
    assert scans == 2 * len(setup.skin)
    for scan in inputs.seen.scans:
        assert file.integer() == scan.sensor
        assert file.array(1, kind="<u4")[0] == scan.counter
        assert file.array(1)[0] == scan.stamp
        np.testing.assert_array_equal(file.array(64), scan.ranges)
        np.testing.assert_array_equal(file.array(64, kind="u1"), scan.status)
    n = file.integer()
    origins_W, points_W, tolerance = file.array(n, 3), file.array(n, 3), file.array(n)
    min_hit, kept = file.array(1)[0], file.array(n, kind="u1")
    answer = px.remove_body(robot, inputs.q, origins_W, points_W, tolerance, min_hit, "paper")
    np.testing.assert_array_equal(kept.astype(bool), answer)
    pair = px.closest_pair(robot, inputs.q, file.array(file.integer(), 3).copy())
    assert file.array(1)[0] == pytest.approx(pair.distance, abs=1e-9)
    assert bytes(file.array(8, kind="u1")) == b"PXBENCHE"
    assert file.at == len(file.data)
