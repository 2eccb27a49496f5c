"""Less work for the garbage collector: what exists before the first test stays, so it is not searched.

Tests of files with many variables make so many objects that all others were searched again and again.
"""

import gc


def pytest_collection():
    gc.disable()


def pytest_collection_finish():
    gc.enable()
    gc.collect()
    gc.freeze()
