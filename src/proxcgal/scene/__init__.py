"""What stands and moves beside the robot."""
