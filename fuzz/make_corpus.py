"""Makes the seeds under fuzz/corpus: python fuzz/make_corpus.py. All of our own making, all small.

The fuzzers begin from these files and the tests run all of them; what a fuzzer finds beyond them
stays under out/fuzz.
"""

from __future__ import annotations

import dataclasses
import io
import json
import struct
from pathlib import Path

import numpy as np

from proxcgal import _core
from proxcgal.recording import codec
from proxcgal.recording.writer import Recorder, Settings
from proxcgal.scenario.loading import load_scenario
from proxcgal.sim.tick import Found, TaskResult, Tick, TickInput, TickResult, TickTruth

CORPUS = Path(__file__).parent / "corpus"

_URDF = """<?xml version="1.0"?><robot name="arm">
<link name="base_link"><visual><geometry><box size="0.2 0.2 0.1"/></geometry></visual></link>
<link name="upper"><visual><origin xyz="0 0 0.25" rpy="0.1 0 0"/>
  <geometry><cylinder radius="0.05" length="0.5"/></geometry></visual></link>
<link name="hand"><collision><geometry><sphere radius="0.08"/></geometry></collision></link>
<link name="part"><visual><geometry><mesh filename="part.off" scale="1 1 -1"/></geometry></visual>
</link>
<joint name="turn" type="revolute"><parent link="base_link"/><child link="upper"/>
  <axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
<joint name="slide" type="prismatic"><parent link="upper"/><child link="hand"/>
  <origin xyz="0 0 0.65"/><axis xyz="0 1 0"/>
  <limit lower="-0.2" upper="0.2" velocity="1" effort="1"/></joint>
<joint name="spin" type="continuous"><parent link="hand"/><child link="part"/></joint>
</robot>"""

_MJCF = """<mujoco model="arm"><compiler angle="radian" meshdir="."/>
<asset><mesh name="part" file="part.off"/></asset>
<worldbody><geom type="plane" size="1 1 1"/>
<body name="base"><geom type="box" size="0.1 0.1 0.05"/>
<body name="upper" pos="0 0 0.1" quat="1 0 0 0"><joint name="a" axis="0 0 1" range="-2 2"/>
<geom type="capsule" size="0.05 0.2" pos="0 0 0.2"/>
<body name="hand" pos="0 0 0.5"><joint name="b" type="slide" axis="0 1 0" range="-0.1 0.1"/>
<geom type="ellipsoid" size="0.05 0.06 0.07"/><site name="tool"/></body></body></body></worldbody>
</mujoco>"""

_XACRO = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="reach" default="0.5"/><xacro:property name="r" value="${$(arg reach) * 0.1}"/>
<xacro:macro name="link" params="name"><link name="${name}"><visual><geometry>
<box size="${r} ${r} ${sin(pi / 2)}"/></geometry></visual></link></xacro:macro>
<xacro:link name="a"/><xacro:link name="b"/><joint name="j" type="revolute"><parent link="a"/>
<child link="b"/><xacro:if value="${r > 0}"><limit lower="-1" upper="${1 + r}" velocity="1"
effort="1"/></xacro:if></joint></robot>"""

_LOOP = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/></robot>"""

_CYCLE = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
<joint name="ab" type="fixed"><parent link="a"/><child link="b"/></joint>
<joint name="bc" type="fixed"><parent link="b"/><child link="c"/></joint>
<joint name="ca" type="fixed"><parent link="c"/><child link="a"/></joint></robot>"""

_ENTITIES = """<?xml version="1.0"?><!DOCTYPE robot [<!ENTITY a "aaaaaaaa">
<!ENTITY b "&a;&a;&a;&a;">]><robot name="&b;"><link name="x"/></robot>"""

_CORNERS = ((0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.1))
_FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))

_DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="inch" meter="0.0254"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="12">0 0 0 1 0 0 0 1 0 0 0 1</float_array>
<technique_common><accessor source="#pa" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="2"><input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3</p>
</triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def main() -> None:
    """Writes every file again."""
    _write("urdf", {"arm": _URDF, "mjcf": _MJCF, "cycle": _CYCLE, "entities": _ENTITIES,
                    "deep": "<robot>" + "<link>" * 300})  # fmt: skip
    _write("xacro_file", {"arm": _XACRO, "loop": _LOOP})
    _write("scenario", _scenarios())
    _write("recording", _recordings())
    # The first byte is the format's place among `meshes.SUFFIXES`.
    _write("mesh_file", {"stl": b"\0" + _stl(), "obj": b"\1" + _obj().encode(),
                         "dae": b"\2" + _DAE.encode(), "ply": b"\3" + _ply().encode(),
                         "off": b"\4" + _off().encode(), "glb": b"\5" + _glb()})  # fmt: skip
    generator = np.random.default_rng(1)
    _write("tick", {f"random{i}": generator.bytes(300 * (i + 1)) for i in range(6)})
    _write("mesh", {f"random{i}": generator.bytes(150 * (i + 1)) for i in range(6)})


def _write(target: str, files: dict[str, str] | dict[str, bytes]) -> None:
    folder = CORPUS / target
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())


def _glb() -> bytes:
    points = np.array(_CORNERS, "<f4").tobytes()
    rows = np.array(_FACES, "<u2").tobytes()
    content = json.dumps({
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": 48},
                        {"buffer": 0, "byteOffset": 48, "byteLength": 24}],
        "buffers": [{"byteLength": 72}],
    }).encode()  # fmt: skip
    content += b" " * (-len(content) % 4)
    body = struct.pack("<I4s", len(content), b"JSON") + content
    body += struct.pack("<I4s", 72, b"BIN\0") + points + rows
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def _scenarios() -> dict[str, str]:
    text = load_scenario("front_plane").to_toml()
    fault = '\n[[fault]]\nkind = "dropout"\nsensor = 3\nfrom = 0.5\nto = 1.5\nvalue = 0.3\n'
    return {
        "plain": text,
        "fault": text + fault,
        "overrides": text + "\0seed=7\0goal.offset=[0.1, 0, 0]\0obstacle.0.size=[1, 1, 1]",
        "wrong": 'kind = "static"\nrobot = 3\nq0 = []\nduration = nan\n[goal]\n[skin]\n',
    }


def _recordings() -> dict[str, bytes]:
    folder = CORPUS / "recording"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "whole.mcap"
    scenario = load_scenario("front_plane")
    settings = Settings(scenario=scenario, controller="wb", seed=0, meshes={"a": "b"}, versions={})
    known = dataclasses.replace(settings, known_points_W=np.zeros((4, 3)))
    files = {}
    for name, inputs in {"whole": settings, "known": known}.items():
        with Recorder(path) as recorder:
            recorder.start(inputs)
            for row in range(3):
                recorder.write(_tick(row))
        files[f"{name}.mcap"] = path.read_bytes()
    files["cut.mcap"] = files["whole.mcap"][:-900]
    data = codec.encode(_tick(1), 0)
    files["tick"] = data[data.index(b',"q":') : data.rindex(b',"crc":')]
    return files


def _tick(row: int) -> Tick:
    scan = _core.Scan(row, row, 0.01 * row, np.full(64, 0.5), np.full(64, 5, np.uint8))
    inputs = TickInput(0.01 * row, np.full(6, 0.1 * row), np.eye(4), (scan,), row == 2)
    result = TickResult(
        qd=np.full(6, 0.01),
        mode=row,
        seen=np.inf,
        link="upper",
        surface_W=(0.1, 0.2, 0.3),
        tasks=(TaskResult("avoidance", (0.1,), (1.0,), (np.nan,)),),
        findings=(Found("sensor_silent", 3, -1, None, 0.2, 2),),
    )
    return Tick(inputs, result, TickTruth(0.4, "upper", 0.3, 0))


def _stl() -> bytes:
    out = io.BytesIO()
    out.write(bytes(80) + struct.pack("<I", len(_FACES)))
    for face in _FACES:
        out.write(struct.pack("<12fH", 0, 0, 0, *(x for v in face for x in _CORNERS[v]), 0))
    return out.getvalue()


def _obj() -> str:
    return _lines("v {} {} {}", _CORNERS) + "f 1//1 3//1 2\nf 1 2 4\nf -1 -2 -3 -4\n"


def _off() -> str:
    return "OFF\n4 4 0\n" + _lines("{} {} {}", _CORNERS) + _lines("3 {} {} {}", _FACES)


def _ply() -> str:
    head = ["ply", "format ascii 1.0", "element vertex 4"]
    head += [f"property float {axis}" for axis in "xyz"]
    head += ["element face 4", "property list uchar int vertex_indices", "end_header"]
    return "\n".join(head) + "\n" + _lines("{} {} {}", _CORNERS) + _lines("3 {} {} {}", _FACES)


def _lines(form: str, rows: tuple[tuple[float, ...], ...]) -> str:
    return "".join(form.format(*row) + "\n" for row in rows)


if __name__ == "__main__":
    main()
