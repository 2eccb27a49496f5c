"""Settings and memory of controllers: the records of core/control/controller.h as NumPy dtypes.

Units and meanings of the fields are explained there.
"""

import numpy as np

from ..core import MOST_CABLES, MOST_CARRIERS
from ..models.record import MOST_ACTUATORS

MOST_TETHERS = 3  # cables of fixed length that hold a carrier

_LIMITS = np.dtype([(name, "f8") for name in ("low", "high", "rate")])
CONTROLLER = np.dtype(
    [
        *((name, "f8", 6) for name in ("kp", "kd", "ki")),
        *((name, "f8") for name in ("observer", "learning", "patience")),
        *((name, "i4") for name in ("reacts", "corrects")),
        ("lowers", "i8"),
        *((name, "f8") for name in ("carrier_bandwidth", "carrier_acceleration")),
        ("reach", "f8", (MOST_CARRIERS, 6)),
        *((name, "f8") for name in ("place", "attitude")),
        ("by_wrench", "f8", (MOST_CARRIERS, MOST_ACTUATORS, 6)),
        ("lean", "f8", MOST_CARRIERS),
        ("limits", _LIMITS, MOST_CABLES),
    ]
)
CABLE = np.dtype(
    [
        *((name, "f8") for name in ("measured", "last", "given", "known", "then", "reported", "commanded", "excess")),
        ("is_cut", "i8"),
    ]
)
_AXIS = np.dtype(
    [*((name, "f8") for name in ("usual", "order")), *((name, "f8", 2) for name in ("late", "rate", "unseen"))]
)
_LATENESS = np.dtype([("sums", "f8", 6), ("compared", "f8"), ("has_begun", "i8")])
PLATFORM = np.dtype(
    [
        *((name, "f8", 6) for name in ("integral", "disturbance", "explained")),
        *((name, "f8") for name in ("unseen", "attitude")),
        ("integrates", "i8"),
        ("silent", "i8"),
        ("axis", _AXIS, 6),
        ("lateness", _LATENESS),
        *((name, "f8") for name in ("lag", "observer")),
    ]
)
_TURN = np.dtype([("steady", "f8", 6), *((name, "f8", 3) for name in ("bent", "away", "rate"))])
CARRIER = np.dtype(
    [
        *((name, "f8", 6) for name in ("offset", "offset_rate")),
        *((name, "f8", 3) for name in ("force", "explained")),
        ("unseen", "f8"),
        *((name, "f8", 3) for name in ("ordered", "turning")),
        ("lacking", "f8"),
        ("wanted", "f8", MOST_ACTUATORS),
        ("limited", "f8"),
        ("turn", _TURN),
    ]
)
TURNING = np.dtype([("axis", _AXIS, (MOST_CARRIERS, 3)), ("lateness", _LATENESS), ("lag", "f8")])
TETHER = np.dtype(
    [
        *((name, "i4") for name in ("carrier", "cables")),
        ("cable", "i4", MOST_TETHERS),
        ("length", "f8", MOST_TETHERS),
        ("at_home", "f8", 3),
        ("farthest", "f8"),
        ("axes", "f8", (3, 3)),
    ],
    align=True,
)
