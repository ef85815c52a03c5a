"""The action server of the 12-joint robot."""
