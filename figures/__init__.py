"""Matplotlib figures and films of datasets and plain arrays: this room knows no robot, no task and no plan."""
