"""Warnings about a motion that no limit of the task forbids, each a sentence."""
