"""The audit: every motion is evaluated again on a dense grid, by code independent of the nonlinear program."""
