"""`check_pulleys`: whether the cables of a robot can run over their pulleys at home."""

import numpy as np

from .cable import Cable


def check_pulleys(offsets: np.ndarray, axes: np.ndarray, radii: np.ndarray, cables: tuple[Cable, ...]) -> None:
    """Refuse an attachment on the swivel axis of its pulley, or inside the sheave.

    Parameters
    ----------
    offsets, axes
        From anchors to attachments, (m, 3) [m], and the swivel axes, (m, 3) [-], in {G} at home.
    radii
        Of the sheaves, (m,) [m]; 0 for a cable without.

    Raises `ValueError` that names the attachment.
    """
    up = np.sum(offsets * axes, axis=1)
    across = np.linalg.norm(offsets - up[:, None] * axes, axis=1)
    outside = (across > 1e-9) & (across**2 - 2 * across * radii + up**2 > 0)
    for index in np.flatnonzero((radii > 0) & ~outside):
        raise ValueError(
            f"cables[{index}].attachment must lie off the swivel axis and outside the sheave of its pulley at "
            f"home, got {cables[index].attachment}"
        )
