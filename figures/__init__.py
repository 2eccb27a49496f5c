"""Matplotlib figures of datasets: this room reads names, units and limits from an `xarray.Dataset` and nothing else."""
