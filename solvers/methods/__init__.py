"""The methods, one file each; `METHODS` lists them by name."""

from .analytic_centre import AnalyticCentre
from .centroid import Centroid
from .closed_form import ClosedForm
from .dykstra import Dykstra
from .improved_closed_form import ImprovedClosedForm
from .largest_margin import LargestMargin
from .least_sum import LeastSum
from .log_barrier import LogBarrier
from .method import Method
from .min_max import MinMax
from .min_norm import MinNorm
from .one_norm import OneNorm
from .p_norm import PNorm
from .qp import ActiveSet, Daqp, QuadraticProgram
from .soft_wrench import SoftWrench
from .two_norm import TwoNorm

_CLASSES: tuple[type[Method], ...] = (
    *(ActiveSet, Daqp, QuadraticProgram, MinNorm, ClosedForm, ImprovedClosedForm, Centroid, OneNorm, TwoNorm, Dykstra),
    *(LeastSum, LargestMargin, MinMax, LogBarrier, AnalyticCentre, PNorm, SoftWrench),
)

METHODS: dict[str, Method] = {kind.name: kind() for kind in _CLASSES}
