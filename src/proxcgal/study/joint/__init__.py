"""The study of the 12-joint robot."""
