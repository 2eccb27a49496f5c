"""Reasons why no motion can be feasible, each with its certificate."""
