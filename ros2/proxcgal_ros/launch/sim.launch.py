"""The simulated robot of a scenario, and the node that controls it.

ros2 launch proxcgal_ros sim.launch.py scenario:=front_plane controller:=wb
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """Both processes."""
    scenario = LaunchConfiguration("scenario")
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "scenario", default_value="front_plane", description="name or path of a scenario"
            ),
            DeclareLaunchArgument(
                "controller", default_value="wb", description="wb (whole body) or sm (sensors)"
            ),
            Node(
                package="proxcgal_ros",
                executable="proxcgal_ros",
                name="proxcgal_robot",
                arguments=["sim", scenario],
                output="screen",
            ),
            Node(
                package="proxcgal_ros",
                executable="proxcgal_ros",
                name="proxcgal",
                arguments=["node"],
                parameters=[
                    {"scenario": scenario, "controller": LaunchConfiguration("controller")}
                ],
                output="screen",
            ),
        ]
    )
