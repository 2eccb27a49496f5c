"""Geometric calibration: robot parameters from measured cable lengths, with their covariance."""

from ..logs.measurements import Measurements, Sigma
from ..logs.reading import read_measurements
from .calibration import Calibration
from .correction import corrected
from .cross_validation import Compared, HeldOut
from .design import next_poses
from .outliers import Outlier, Slip
from .parameters import Parameter
from .plausibility import Mistake, mistake
from .run import calibrate

__all__ = [
    "Calibration",
    "Compared",
    "HeldOut",
    "Measurements",
    "Mistake",
    "Outlier",
    "Parameter",
    "Sigma",
    "Slip",
    "calibrate",
    "corrected",
    "mistake",
    "next_poses",
    "read_measurements",
]
