"""Hold datasets as plain data and save them as NetCDF, without loading xarray and pandas, which cost a second each."""

from __future__ import annotations

import gc
import io
import mmap
import sys
import threading
import warnings
from collections.abc import Collection, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from typing_extensions import override

from .declared import check_hdf5, check_heaps
from .inputs import InputError, printable, shown
from .reading import check_file
from .writing import whole_file

if TYPE_CHECKING:
    import h5py
    import xarray as xr

_alone = threading.Lock()
LARGEST = 4_000_000_000  # [bytes]; an hour of a flight with a sample each millisecond
# Units of motions of platform and carriers, and of tensions.
UNITS = {"time": "s", "pose": "m, rad", "velocity": "m/s, rad/s", "acceleration": "m/s^2, rad/s^2", "tensions": "N"}


class Variable(NamedTuple):
    """Values over named dimensions, with attributes such as `units` and `long_name`."""

    dims: tuple[str, ...]
    values: np.ndarray  # one axis for each of `dims`
    attributes: Mapping[str, Any] = {}


class Contents(NamedTuple):
    """The contents of an `xarray.Dataset`; a coordinate is one of its dimension if the names are the same."""

    variables: Mapping[str, Variable]
    coordinates: Mapping[str, Variable]
    attributes: Mapping[str, Any]

    @classmethod
    def of(cls, dataset: xr.Dataset) -> Contents:
        """Return the contents of a dataset."""
        own = dataset.variables  # the values of `data_vars` are arrays with coordinates, which take long to make
        variables, coordinates = (
            {str(name): Variable(tuple(map(str, own[name].dims)), own[name].values, own[name].attrs) for name in part}
            for part in (dataset.data_vars, dataset.coords)
        )
        return cls(variables, coordinates, dataset.attrs)

    def get(self, name: str) -> Variable | None:
        """Return a variable or coordinate, or None if there is none of that name."""
        return self.variables.get(name) or self.coordinates.get(name)

    def dataset(self) -> xr.Dataset:
        """Return the contents as an `xarray.Dataset`."""
        import xarray as xr

        return xr.Dataset(dict(self.variables), dict(self.coordinates), dict(self.attributes))


def save_netcdf(contents: Contents, path: Path, compressed: Collection[str] = ()) -> Path:
    """Save contents as NetCDF 4 atomically; `xarray.load_dataset` reads them.

    Equal contents are equal files. The variables named by `compressed` are compressed. Raises `InputError` if the
    folder cannot be written to, or the disk is full.
    """
    import h5netcdf
    import h5py

    # In memory first: HDF5 brings the process down, file left behind, where a disk is full.
    content = io.BytesIO()
    everything = {**contents.coordinates, **contents.variables}
    with _file()(content, "w", track_order=True) as opened, h5netcdf.File(opened, "w") as file:
        file.dimensions = {
            name: size
            for variable in everything.values()
            for name, size in zip(variable.dims, np.shape(variable.values), strict=True)
        }
        file.attrs.update(contents.attributes)
        for name, variable in everything.items():
            values, attributes = np.asarray(variable.values), dict(variable.attributes)
            # Coordinates besides those of the dimensions are named by this convention (CF 1.11, section 5).
            beside = [
                other
                for other, coordinate in contents.coordinates.items()
                if other not in coordinate.dims and set(coordinate.dims) <= set(variable.dims)
            ]
            if name in contents.variables and beside:
                attributes["coordinates"] = " ".join(beside)
            if values.dtype.kind == "b":
                values, attributes["dtype"] = values.astype(np.int8), "bool"
            elif values.dtype.kind == "U":
                values = values.astype(object)
            packing = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if name in compressed else {}
            kind = h5py.string_dtype() if values.dtype.kind == "O" else values.dtype
            saved = file.create_variable(name, variable.dims, kind, data=values, **packing)
            saved.attrs.update(attributes)
    with whole_file(path) as temporary:
        temporary.write_bytes(content.getvalue())
    return path


def load_netcdf(path: Path, refusal: str) -> xr.Dataset:
    """Load a NetCDF file into memory; `check_hdf5` looks at all that it declares first.

    Raises `InputError` if it cannot or must not be read: `refusal`, and the reason in brackets.
    """
    import h5netcdf
    import xarray as xr

    with _alone:  # the hook and the warnings belong to the whole process
        # A damaged file leaves a half-opened one behind, whose closing prints a traceback as soon as it is collected.
        hook, sys.unraisablehook, is_opened = sys.unraisablehook, lambda unraisable: None, False
        try:
            try:
                size = check_file(path, "a NetCDF file", LARGEST)
                with _file()(path) as file, open(path, "rb") as stream:
                    with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
                        check_heaps(content)
                    check_hdf5(file, size)
                    with warnings.catch_warnings():
                        warnings.simplefilter("ignore")  # of what is unusual; whoever uses it checks what matters
                        is_opened = True
                        opened = h5netcdf.File(file, "r", decode_vlen_strings=True, phony_dims="access")
                        return xr.load_dataset(xr.backends.H5NetCDFStore(opened))
            except Exception as error:  # it may fail at any place of three libraries
                # HDF5 has its own message of several lines, where others have a few words.
                reason = printable((str(getattr(error, "strerror", None) or error) or "empty").splitlines()[0])
                reason = "not a NetCDF file" if "signature not found" in reason else reason
            if is_opened:
                gc.collect()
        finally:
            sys.unraisablehook = hook
    raise InputError(f"{refusal} ({reason})")


@cache
def _file() -> type[h5py.File]:
    """Return the class of files that look up each name once: h5netcdf does so for each property of a variable."""
    import h5py

    class File(h5py.File):
        @override
        def __getitem__(self, name: Any) -> Any:
            if not isinstance(name, str):  # a reference
                return super().__getitem__(name)
            kept = self.__dict__.setdefault("_kept", {"/": self})
            return kept[name] if name in kept else kept.setdefault(name, super().__getitem__(name))

        @override
        def __delitem__(self, name: str) -> None:
            self.__dict__["_kept"] = {"/": self}
            super().__delitem__(name)

    return File


def check_units(name: str, attributes: Mapping[Any, Any]) -> None:
    """Raise InputError if a variable of a motion states other units than towline writes; it may state none."""
    accepted = UNITS.get(name.removeprefix("carrier_").removeprefix("reference_"), "")
    given = attributes.get("units", accepted)
    if accepted and not (isinstance(given, str) and given == accepted):
        raise InputError(f"{name} must have the units {accepted!r}, got {shown(given)}")


def numbers_of(
    dataset: xr.Dataset | Contents,
    name: str,
    shape: tuple[int, ...],
    where: str,
    gaps: bool = False,
    largest: float = 1e12,
) -> np.ndarray:
    """Return a copy of a variable's numbers, of the expected shape, -1 for any length; `gaps` permits nan.

    Raises `InputError` that names the dataset as `where` if they are anything else.
    """
    if not isinstance(dataset, Contents):  # which may be larger than the memory
        dataset = Contents.of(dataset[[name] if name in dataset.variables else []])
    variable = dataset.get(name)
    kind = None if variable is None else np.asarray(variable.values).dtype
    if variable is None or kind is None or kind.kind not in "fiu":
        given = "none" if kind is None else f"an array of {kind}"
        raise InputError(f"{where}: {name} must be an array of numbers, got {given}")
    try:
        check_units(name, variable.attributes)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    values = np.array(variable.values, dtype=float)
    fits = values.ndim == len(shape) and all(want in (-1, have) for want, have in zip(shape, values.shape, strict=True))
    if not fits:
        raise InputError(f"{where}: {name} must have the shape {shape} for its robot, got {values.shape}")
    wrong = ~(np.abs(values) <= largest) & ~(gaps & np.isnan(values))
    if wrong.any():
        raise InputError(f"{where}: {name} must have numbers up to {largest:g}, got {values[wrong][0]:g}")
    return values
