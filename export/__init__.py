"""What other programs take over: the control step as C, robots as MuJoCo models and as functional mock-up units."""
