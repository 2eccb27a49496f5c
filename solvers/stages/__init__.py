"""Kernels of `horizon`: a Riccati recursion inside an interior-point method, all in one array of numbers."""
