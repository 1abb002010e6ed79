# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0
"""The mapping node behind an odometry: ros2 launch turbomap_ros mapping.launch.py image:=/cam0/image_raw ..."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

TOPICS = {'image': '/camera/image_raw', 'camera_info': '/camera/camera_info', 'pose': '/odometry/pose'}


def generate_launch_description():
    arguments = [DeclareLaunchArgument(name, default_value=topic) for name, topic in TOPICS.items()]
    arguments.append(DeclareLaunchArgument('frame_id', default_value='map'))
    node = Node(
        package='turbomap_ros',
        executable='mapping_node',
        output='screen',
        parameters=[{'frame_id': LaunchConfiguration('frame_id')}],
        remappings=[(name, LaunchConfiguration(name)) for name in TOPICS],
    )
    return LaunchDescription(arguments + [node])
