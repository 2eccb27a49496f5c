"""Random checks of everything that towline claims: `python -m tests.soak NAME`."""
