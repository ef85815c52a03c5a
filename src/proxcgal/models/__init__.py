"""Robots and sensor layouts: from description files to what controller and simulator use."""
