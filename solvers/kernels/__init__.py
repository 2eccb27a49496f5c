"""The kernels, in plain Python and NumPy; `compiled.py` turns them into machine code where that pays."""
