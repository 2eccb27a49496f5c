"""Timings on this machine beside other software, and `soak`, which checks random cases."""
