"""The simulated robot of a scenario, and the node that controls it.

ros2 launch proxcgal_ros sim.launch.py scenario:=front_plane controller:=wb
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue


def generate_launch_description() -> LaunchDescription:
    """Both processes."""
    scenario = LaunchConfiguration("scenario")
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "scenario", default_value="front_plane", description="name or path of a scenario"
            ),
            DeclareLaunchArgument(
                "controller",
                default_value="wb",
                choices=["wb", "sm", "wb_memory"],
                description="whole body, sensors only, or whole body with a memory",
            ),
            Node(
                package="proxcgal_ros",
                executable="proxcgal_ros",
                arguments=["sim", scenario],  # two nodes: neither is given a name
                output="screen",
            ),
            Node(
                package="proxcgal_ros",
                executable="proxcgal_ros",
                name="proxcgal",
                arguments=["node"],
                parameters=[
                    {
                        # Texts, whatever YAML would make of them.
                        name: ParameterValue(LaunchConfiguration(name), value_type=str)
                        for name in ("scenario", "controller")
                    }
                ],
                output="screen",
            ),
        ]
    )
