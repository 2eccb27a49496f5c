"""Plan one task many times, with fields of the task or of the robot varied: `sweep`."""
