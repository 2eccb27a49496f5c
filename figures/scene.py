"""`Scene`: a robot at some instants, as pictures, views and films show it."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Scene:
    """A robot at k instants; everything in {G} [m]."""

    title: str
    anchors: np.ndarray  # (k, m, 3)
    attachments: np.ndarray  # likewise
    # Origins of the carriers' frames (k, c, 3), and their names; ground carriers are not among them.
    carriers: np.ndarray
    names: list[str]  # likewise
    bodies: list[np.ndarray]  # for each carrier the indices of its cables; three or more anchors are drawn as a body
    boxes: list[tuple[np.ndarray, np.ndarray]]  # corners (low, high) of reach boxes
    tensions: np.ndarray  # (k, m) [N], nan where there are none
    t_min: np.ndarray  # (m,) [N]
    t_max: np.ndarray  # likewise
    # Circles in which rotors turn, (k, r, p, 3); default: none.
    rotors: np.ndarray = field(default_factory=lambda: np.zeros((1, 0, 2, 3)))
    # Points of the platform's surface, (k, n, 3), whose hull is drawn; default: the attachments.
    surface: np.ndarray | None = None
    cut: np.ndarray | None = None  # which cables have been cut, (k, m); None if none are
    # Origin of the platform's frame (n, 3) over times [s] of their own, fine enough for a smooth trail; default: none.
    path: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    path_times: np.ndarray = field(default_factory=lambda: np.zeros(0))
    path_missing: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))  # where no tensions give the motion
    # For each region to keep out of, the lines that outline it, (n, 3) each; default: none.
    obstacles: list[list[np.ndarray]] = field(default_factory=list)

    @property
    def platform(self) -> np.ndarray:
        """Return the points whose hull is drawn as the platform, (k, n, 3)."""
        return self.attachments if self.surface is None else self.surface

    @property
    def points(self) -> np.ndarray:
        """Return all points of the robot and of its path at all instants, (n, 3)."""
        parts = (self.anchors, self.attachments, self.platform, self.path, self.carriers, self.rotors, *self.boxes)
        return np.vstack([np.reshape(part, (-1, 3)) for part in parts])

    @property
    def standing(self) -> np.ndarray:
        """Return the indices of the cables whose anchors never move."""
        return np.setdiff1d(np.arange(self.anchors.shape[1]), np.concatenate([np.zeros(0, int), *self.bodies]))
