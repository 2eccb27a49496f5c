"""Export for other programs: the control step as C, robots as MuJoCo models and as functional mock-up units."""
