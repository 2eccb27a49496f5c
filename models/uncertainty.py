"""How well the numbers of a robot file are known: `Uncertainty`, a covariance, and robots drawn from it."""

from typing import Annotated, Self

import numpy as np
from pydantic import AfterValidator, Field, field_validator, model_validator

from .parameters import locate
from .part import Finite, Part

ROUNDING = 1e-9  # of the largest number of the covariance, in its symmetry and in its eigenvalues


ParameterName = Annotated[str, AfterValidator(lambda name: locate(name) and name)]


class Uncertainty(Part):
    """The covariance of some parameters of a robot: their errors are normally distributed about the file's values."""

    parameters: tuple[ParameterName, ...] = Field(
        min_length=1,
        description="names such as cables[2].anchor.x, cables[2].pulley.radius, cables[2].encoder.scale; "
        "cables are numbered from 0",
    )
    covariance: tuple[tuple[Finite, ...], ...] = Field(
        description="covariance of these parameters, in products of their units, such as m^2; "
        "symmetric, no negative eigenvalues"
    )

    @field_validator("parameters")
    @classmethod
    def _are_different(cls, parameters: tuple[str, ...]) -> tuple[str, ...]:
        for index, name in enumerate(parameters):
            if name in parameters[:index]:
                raise ValueError(f"must name each parameter once, got {name} twice")
        return parameters

    @model_validator(mode="after")
    def _is_a_covariance(self) -> Self:
        p = len(self.parameters)
        lengths = {len(row) for row in self.covariance}
        if len(self.covariance) != p or lengths != {p}:
            got = f"{len(self.covariance)} rows of {' or '.join(str(n) for n in sorted(lengths)[:9]) or 'no'} numbers"
            raise ValueError(f"covariance must have {p} rows of {p} numbers, one for each parameter, got {got}")
        matrix = self.matrix
        largest = np.abs(matrix).max()
        apart = np.abs(matrix - matrix.T)
        if apart.max() > ROUNDING * largest:
            i, j = np.unravel_index(np.argmax(apart), apart.shape)
            raise ValueError(
                f"covariance must be symmetric, got {matrix[i, j]:g} in row {i + 1} and {matrix[j, i]:g} in row {j + 1}"
            )
        least = float(np.linalg.eigvalsh(matrix)[0])
        if least < -ROUNDING * largest:
            raise ValueError(f"covariance must have no negative eigenvalues, got one of {least:g} m^2")
        return self

    def __hash__(self) -> int:
        """Return a hash of names and variances; to hash all numbers would take longer than a call that looks it up."""
        return hash((self.parameters, tuple(row[i] for i, row in enumerate(self.covariance))))

    @property
    def geometry(self) -> Self | None:
        """Return the uncertainty of anchors, attachments and pulleys alone; None if only encoders are uncertain."""
        kept = [i for i, name in enumerate(self.parameters) if locate(name).part != "encoder"]
        if len(kept) == len(self.parameters):
            return self
        covariance = self.matrix[np.ix_(kept, kept)].tolist()
        names = tuple(self.parameters[i] for i in kept)
        return type(self)(parameters=names, covariance=covariance) if kept else None

    @property
    def matrix(self) -> np.ndarray:
        """Return the covariance, (p, p), in products of the parameters' units, such as [m^2]."""
        return np.array(self.covariance)  # (p, p)

    @property
    def sigmas(self) -> np.ndarray:
        """Return the standard deviations of the parameters, (p,), in their units, such as [m]."""
        return np.sqrt(np.maximum(np.diag(self.matrix), 0.0))  # (p,)

    @property
    def factor(self) -> np.ndarray:
        """Return S with S S^T equal to the covariance, (p, r), in units such as [m]; r is its rank."""
        units = np.where(self.sigmas > 0.0, self.sigmas, 1.0)  # some parameters have other units than others
        eigenvalues, directions = np.linalg.eigh(self.matrix / np.outer(units, units))
        kept = eigenvalues > ROUNDING * max(eigenvalues[-1], 0.0)
        return units[:, None] * directions[:, kept] * np.sqrt(eigenvalues[kept])  # (p, r)

    def errors(self, count: int, seed: int) -> np.ndarray:
        """Draw errors of the parameters, (count, p), in their units, such as [m]; the same ones for the same seed."""
        factor = self.factor
        return np.random.default_rng(seed).standard_normal((count, factor.shape[1])) @ factor.T  # (count, p)
