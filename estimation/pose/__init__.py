"""Forward kinematics: the pose of the platform from the lengths of its cables."""
