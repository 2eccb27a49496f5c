"""What measurements show: the pose from cable lengths (`pose`) and the robot as built (`calibration`)."""
