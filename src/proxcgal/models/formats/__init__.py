"""Readers of robot descriptions: URDF, xacro, MJCF, capsule robots."""
