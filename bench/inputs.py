"""Writes cells of the timing grid as files that a benchmark reads without Python.

    python bench/inputs.py out/bench                             both robots, 10000 vertices, raw
    python bench/inputs.py out/bench --vertices 100 1000 --clouds raw 2m 1m
    python bench/inputs.py out/bench --scans 100                 a hundred scans: 192000 zones

Each file is ROBOT_VERTICES_CLOUD.bin, or ROBOT_VERTICES_CLOUD_xSCANS.bin where there are several.

The format: one value after another, little-endian, nothing between them (read with memcpy, not
through casts). i32, u32, u8 are integers, f64 is a double; [n] is n values, matrices row by row.
A text is its length as i32 and then its bytes, UTF-8. SI units, radians; frames as in the docs.

    magic           u8[8]            "PXBENCH1"
    robot           text             its name
    n_joints        i32
      per joint     text name, i32 type (0 revolute, 1 prismatic), i32 parent (row, -1 the base),
                    f64[16] origin (frame at q = 0 in the parent's), f64[3] axis,
                    f64 q_min, q_max, qd_max, qdd_max (may be inf)
    tool            text name, i32 joint, f64[16] T_JT
    n_links         i32
      per link      text name, i32 joint (row, -1 the base), f64[16] T_JL, f64 mesh_error,
                    i32 v, f64[3 v] vertices_L, i32 f, i32[3 f] triangles
    posture         f64[n_joints] q, f64[16 n_links] T_WL at q, f64[16] goal T_WT
    sensor model    f64 field_of_view, min_range, max_range, workspace, sigma_floor, sigma_ratio,
                    i32 range_model (0 tangent, 1 printed)
    n_mounts        i32
      per mount     text name, i32 link (row), f64[16] T_LS
    n_scans         i32              in the order of their stamps
      per scan      i32 sensor (row of the mounts), u32 counter, f64 stamp,
                    f64[64] ranges, u8[64] status
    Algorithm 1     i32 n, f64[3 n] origins_W, f64[3 n] points_W, f64[n] tolerance, f64 min_hit,
                    u8[n] kept       (1 where `method="paper"` keeps the point)
    Algorithm 2     i32 m, f64[3 m] points_W, f64 distance (of `method="paper"`)
    end             u8[8]            "PXBENCHE"
"""

from __future__ import annotations

import argparse
import struct
import sys
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from proxcgal.scenario.loading import load_scenario
from proxcgal.study.timing.grid import call_of
from proxcgal.study.timing.inputs import REACH, SCENARIOS, Inputs, grid_inputs

MAGIC, END = b"PXBENCH1", b"PXBENCHE"
MIN_HIT = 0.005  # [m] default of px.remove_body
JOINT_TYPES = ("revolute", "prismatic")
RANGE_MODELS = ("tangent", "printed")


class Writer:
    """Values one after another."""

    def __init__(self) -> None:
        self.content = bytearray()

    def text(self, text: str) -> None:
        data = text.encode()
        self.integers(len(data))
        self.content += data

    def integers(self, *values: int) -> None:
        self.content += struct.pack(f"<{len(values)}i", *values)

    def array(self, values: ArrayLike, kind: str = "<f8") -> None:
        self.content += np.ascontiguousarray(values, kind).tobytes()


def encode(inputs: Inputs) -> bytes:
    """One cell, as the format above has it."""
    out = Writer()
    out.content += MAGIC
    _robot(out, inputs)
    setup = inputs.seen.setup
    out.array(inputs.q)
    out.array(inputs.robot.link_poses(inputs.q))
    out.array(setup.goal)
    _sensors(out, inputs)
    kept, pair = call_of(inputs, 1, "paper")(), call_of(inputs, 2, "paper")()
    out.integers(len(inputs.points_W))
    for values in (inputs.origins_W, inputs.points_W, inputs.tolerance, MIN_HIT):
        out.array(values)
    out.array(kept, "u1")
    out.integers(len(inputs.environment_W))
    out.array(inputs.environment_W)
    out.array(pair.distance)
    out.content += END
    return bytes(out.content)


def _robot(out: Writer, inputs: Inputs) -> None:
    robot, described = inputs.robot, inputs.robot.description
    out.text(robot.name)
    out.integers(len(described.joints))
    for joint in described.joints:
        out.text(joint.name)
        out.integers(JOINT_TYPES.index(joint.type), joint.parent)
        out.array(joint.origin)
        out.array(joint.axis)
        out.array((joint.q_min, joint.q_max, joint.qd_max, joint.qdd_max))
    tool = described.tool_frame
    out.text(tool.name)
    out.integers(tool.joint)
    out.array(tool.T_JF)
    out.integers(len(described.links))
    for link in described.links:
        vertices_L, triangles = robot.mesh(link.name)
        out.text(link.name)
        out.integers(link.joint)
        out.array(link.T_JL)
        out.array(robot.mesh_error(link.name))
        out.integers(len(vertices_L))
        out.array(vertices_L)
        out.integers(len(triangles))
        out.array(triangles, "<i4")


def _sensors(out: Writer, inputs: Inputs) -> None:
    skin, links = inputs.seen.setup.skin, inputs.robot.link_names
    model = skin.model
    out.array((model.field_of_view, model.min_range, model.max_range, model.workspace,
               model.sigma_floor, model.sigma_ratio))  # fmt: skip
    out.integers(RANGE_MODELS.index(model.range_model))
    out.integers(len(skin.mounts))
    for mount in skin.mounts:
        out.text(mount.name)
        out.integers(links.index(mount.link))
        out.array(mount.T_LS)
    out.integers(len(inputs.seen.scans))
    for scan in inputs.seen.scans:
        out.integers(scan.sensor)
        out.array(scan.counter, "<u4")
        out.array(scan.stamp)
        out.array(scan.ranges)
        out.array(scan.status, "u1")


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--scenario", nargs="+", default=SCENARIOS, metavar="NAME|PATH")
    parser.add_argument("--vertices", nargs="+", type=int, default=[10000], metavar="N")
    parser.add_argument("--clouds", nargs="+", choices=tuple(REACH), default=["raw"])
    parser.add_argument("--scans", type=int, default=1, metavar="N", help="of each sensor")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    several = f"_x{options.scans}" if options.scans > 1 else ""
    for name in options.scenario:
        grid = grid_inputs(load_scenario(name), options.vertices, options.clouds, options.scans)
        for inputs in grid:
            cell = f"{inputs.robot.name}_{inputs.vertices}_{inputs.cloud}{several}"
            path = options.folder / f"{cell}.bin"
            path.write_bytes(encode(inputs))
            print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
