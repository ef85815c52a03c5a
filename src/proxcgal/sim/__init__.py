"""The simulated world, sensors and arm, and the loop through the tick."""
