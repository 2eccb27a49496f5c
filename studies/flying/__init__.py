"""Paper F: a six-cable platform under a quadrotor."""
