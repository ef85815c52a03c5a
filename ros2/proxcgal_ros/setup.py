"""proxcgal_ros: a plain ament_python package; colcon and pip both build it."""

from setuptools import setup

NAME = "proxcgal_ros"

setup(
    name=NAME,
    version="0.1.0",
    description="Whole-arm avoidance from proximity sensors as a ROS 2 node.",
    license="GPL-3.0-or-later",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/sim.launch.py"]),
    ],
    python_requires=">=3.11",
    install_requires=["proxcgal", "rosbags>=0.11.9,<0.12"],
    zip_safe=True,
    entry_points={"console_scripts": [f"{NAME} = {NAME}.cli:main"]},
)
