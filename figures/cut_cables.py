"""Where cables end as they are drawn: at the platform, or hanging from their anchors once they have been cut."""

import numpy as np

LEFT = 0.25  # of its length that is drawn of a cable that has been cut


def drawn_ends(anchors: np.ndarray, attachments: np.ndarray, cut: np.ndarray | None) -> np.ndarray:
    """Return the ends of cables in {G} [m], (..., m, 3) as anchors and attachments are; `cut` is (..., m) or None.

    A cut cable is drawn hanging from its anchor. Its true length depends on where it broke.
    """
    if cut is None:
        return attachments
    down = np.array([0.0, 0.0, -LEFT]) * np.linalg.norm(attachments - anchors, axis=-1, keepdims=True)
    return np.where(cut[..., None], anchors + down, attachments)
