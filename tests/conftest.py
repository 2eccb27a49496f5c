"""Less work for the garbage collector, which would take a tenth of the time of all tests.

What exists before the first test stays, so it is not searched. The rest is searched after more new objects than usual.
"""

import gc

NEW_OBJECTS = 20_000


def pytest_collection():
    gc.disable()


def pytest_collection_finish():
    gc.enable()
    gc.set_threshold(NEW_OBJECTS)
    gc.collect()
    gc.freeze()
