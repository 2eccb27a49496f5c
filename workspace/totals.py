"""`Totals`: the results of a run's jobs added up, and the dataset of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .domain import Domain
from .jobs import JobResult, cells_of_counts, width_of
from .refinement import Refinement
from .volume import LEVEL, share_interval

if TYPE_CHECKING:
    import xarray as xr

AXES, ANGLES = ["x", "y", "z"], ["roll", "pitch", "yaw"]


class Totals:
    """Add up job results in the order of their samples, so that the kept samples do not depend on timing.

    Attributes
    ----------
    tried, accepted
        Numbers of samples so far.
    """

    def __init__(self, domain: Domain, points_max: int):
        self.tried = self.accepted = 0
        self._domain, self._left = domain, points_max
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)
        self._counts = np.zeros((2, *cells_of_counts(domain)), dtype=np.int64)
        self._samples: list[np.ndarray] = []
        self._flags: list[np.ndarray] = []

    @property
    def keeps_more(self) -> bool:
        """Return whether more samples can be kept."""
        return self._left > 0

    def add(self, result: JobResult) -> None:
        """Add the result of the next job."""
        self.tried += sum(result.sizes)
        self.accepted += int(result.counts[1].sum())
        self._low, self._high = np.minimum(self._low, result.low), np.maximum(self._high, result.high)
        self._counts += result.counts
        if self._left > 0 and len(result.samples):
            self._samples.append(result.samples[: self._left])
            self._flags.append(result.accepted[: self._left])
            self._left -= len(self._samples[-1])

    def dataset(self, keep: str, method: str, refinement: Refinement | None) -> xr.Dataset:
        """Return all of it as a dataset, which `sample` documents."""
        import xarray as xr

        domain = self._domain
        low, high = domain.box
        middles = [
            lowest + (np.arange(count) + 0.5) * (highest - lowest) / count
            for lowest, highest, count in zip(low, high, self._counts.shape[1:], strict=True)
        ]
        metres = {"units": "m"}
        bounds = np.stack([self._low, self._high]) if self.accepted else np.full((2, 3), np.nan)
        variables: dict[str, Any] = {
            "bounds": (("end", "axis"), bounds, metres),
            "tried": (("x", "y", "z"), self._counts[0], {"units": "1", "long_name": "samples tried in the cell"}),
            "reached": (("x", "y", "z"), self._counts[1], {"units": "1", "long_name": "samples accepted in the cell"}),
            **_measures(self._counts, domain, self.tried, self.accepted, method, refinement),
        }
        coordinates: dict[str, Any] = {
            "axis": AXES,
            "end": ["min", "max"],
            **{name: ((name,), at, metres) for name, at in zip(AXES, middles, strict=True)},
        }
        if keep != "none":
            variables |= self._kept(keep)
            coordinates |= {"angle": ANGLES} if domain.attitude_varies else {}
            names = [carrier.name for carrier in domain.robot.carriers]
            coordinates |= {"carrier": names} if domain.carriers_vary else {}
        if refinement is not None:
            corners, _ = domain.places(refinement.cells)
            upper, _ = domain.places(refinement.cells + refinement.edges)
            centres = (corners.pose[:, :3] + upper.pose[:, :3]) / 2
            edges = np.zeros(6 + 3 * len(domain.robot.carriers))
            edges[domain.varying] = domain.extent * refinement.edges
            about = {"units": "m", "long_name": "centres of the smallest cells, which the boundary passes through"}
            variables["boundary"] = (("cell", "axis"), centres, about)
            variables["cell_edges"] = (("axis",), edges[:3], {"units": "m", "long_name": "edges of the smallest cells"})
        return xr.Dataset(variables, coordinates)

    def _kept(self, keep: str) -> dict[str, Any]:
        domain = self._domain
        rows = np.vstack(self._samples) if self._samples else np.empty((0, width_of(domain)))
        kept: dict[str, Any] = {"position": (("point", "axis"), rows[:, :3], {"units": "m"})}
        if domain.attitude_varies:
            kept["attitude"] = (("point", "angle"), rows[:, 3:6], {"units": "rad"})
        if domain.carriers_vary:
            where = rows[:, 6 if domain.attitude_varies else 3 :].reshape(len(rows), len(domain.robot.carriers), 3)
            kept["carrier_position"] = (("point", "carrier", "axis"), where, {"units": "m"})
        if keep == "all":
            flags = np.concatenate(self._flags) if self._flags else np.empty(0, dtype=bool)
            kept["accepted"] = (("point",), flags, {"long_name": "whether the condition holds"})
        return kept


def _measures(
    counts: np.ndarray, domain: Domain, tried: int, accepted: int, method: str, refinement: Refinement | None
) -> dict[str, Any]:
    """Return the volume and its interval."""
    whole = domain.measure
    if refinement is not None:
        ends = refinement.inside, refinement.inside + refinement.mixed
        value = refinement.estimate
        about = "lowest and highest, if the first cells miss nothing"
    elif domain.position_from_lengths:
        value = np.count_nonzero(counts[1]) / counts[1].size
        ends = np.nan, np.nan
        about = "no interval: positions are not uniform; the volume is that of the cells reached"
    elif method == "grid":
        value, ends = accepted / tried, (np.nan, np.nan)
        about = "no interval: a grid is not random; it can be off by half a layer of cells along the boundary"
    else:
        value, ends = accepted / tried, share_interval(accepted, tried)
        about = f"{100 * LEVEL:g} % confidence interval of Clopper and Pearson"
        about += f"; for {method} the error is usually smaller" * (method in ("sobol", "halton"))
    unit = {"units": domain.measure_unit}
    return {
        "volume": ((), whole * value, unit),
        "volume_interval": (("end",), [whole * end for end in ends], {**unit, "long_name": about}),
    }
