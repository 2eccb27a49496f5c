"""Functions of numbers compiled to machine code."""
