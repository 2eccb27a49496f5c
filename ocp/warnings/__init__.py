"""Warnings of what a motion does that no limit of the task forbids, each a sentence."""
