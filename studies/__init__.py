"""Studies of the two papers."""
