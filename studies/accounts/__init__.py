"""What became of a paper: its claims, one verdict each, and the files that tell it."""
