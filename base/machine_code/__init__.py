"""Functions of numbers compiled to machine code, and arithmetic on vectors."""
