"""What other programs take over: the control step as C, and robots as MuJoCo models."""
