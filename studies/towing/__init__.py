"""Paper C: a load towed by three to six robots."""
