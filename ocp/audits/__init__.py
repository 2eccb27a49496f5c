"""The audit of every motion: evaluated again, densely, by code that is not the nonlinear program."""
