"""Timings on this machine, each a module to run: `python -m towline.benchmarks.batch`."""
