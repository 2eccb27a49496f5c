"""The fastest time law along a path: `time_along`."""
