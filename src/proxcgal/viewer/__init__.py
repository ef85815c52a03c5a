"""The live page and the replay page."""
