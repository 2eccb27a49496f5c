"""`with_jumps`: a motion as a dataset with further rows at the jumps of its acceleration; `rows_with_jumps` reads them.

The rows of a motion are equally spaced in time. Polynomials between two rows overshoot where the acceleration jumps
between them. Variables with the prefix `jump_`, over the dimension `jump`, therefore contain the motion just before and
just after each jump. They hold only for the rows that they were saved with, which a checksum identifies: of a dataset
that was cut or changed, the rows alone are used.
"""

from collections.abc import Mapping
from zlib import crc32

import numpy as np

from ..base.netcdf import Contents, Variable

PREFIX, CHECKSUM = "jump_", "jump_checksum"
SAME = 1e-9  # [s]: a row that is nearer to a jump is left out, because rounding decides on which side of it it is


def with_jumps(contents: Contents, at_jumps: Mapping[str, Variable]) -> Contents:
    """Return a dataset with variables just before and after each of k jumps, (2 k, ...) each; `{}` for none.

    Jumps must be further than `SAME` from both ends of the motion.
    """
    if not at_jumps:
        return contents
    further = {PREFIX + name: its._replace(dims=("jump", *its.dims[1:])) for name, its in at_jumps.items()}
    whole = contents._replace(variables={**contents.variables, **further})
    return whole._replace(attributes={**contents.attributes, CHECKSUM: _checksum(whole)})


def rows_with_jumps(samples: Contents) -> Contents:
    """Return samples whose motion and tensions have the rows at jumps among the others.

    Each time of a jump is there twice. Samples without jumps, or that were changed after they were saved, are returned
    as they are.
    """
    at, rows = samples.get(PREFIX + "time"), samples.get("time")
    if at is None or rows is None or not np.array_equal(samples.attributes.get(CHECKSUM, ()), _checksum(samples)):
        return samples
    jumps, times = at.values, rows.values
    after = np.searchsorted(jumps, times).clip(1, len(jumps) - 1)
    kept = np.minimum(np.abs(times - jumps[after - 1]), np.abs(jumps[after] - times)) > SAME
    order = np.argsort(np.concatenate([times[kept], jumps]), kind="stable")

    def merged(variables: Mapping[str, Variable]) -> dict[str, Variable]:
        changed = dict(variables)
        for name, its in variables.items():
            if further := samples.variables.get(PREFIX + name):
                changed[name] = its._replace(values=np.concatenate([its.values[kept], further.values])[order])
        return changed

    return Contents(merged(samples.variables), merged(samples.coordinates), samples.attributes)


def _checksum(samples: Contents) -> int:
    """Return a checksum of the values at jumps and of those at rows that they belong to."""
    names = sorted(name for name in samples.variables if name.startswith(PREFIX))
    parts = [samples.get(each) for name in names for each in (name, name.removeprefix(PREFIX))]
    return crc32(b"".join(np.ascontiguousarray(part.values).tobytes() for part in parts if part is not None))
