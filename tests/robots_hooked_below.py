"""flycrane whose cables begin below the CoM of its quadrotors."""

import numpy as np
from scipy.spatial.transform import Rotation

from towline.models import Robot, load


def hooked_below(depth):
    """Return flycrane with its anchors `depth` [m] below the quadrotors' CoM, where its cables end as before."""
    data = load("flycrane").model_dump(mode="json")
    for cable in data["cables"]:
        cable["anchor"] = [0, 0, -depth]
    for carrier in data["carriers"]:
        up = Rotation.from_euler("ZYX", carrier["home"][:2:-1]).as_matrix()[:, 2]
        carrier["home"][:3] = (np.array(carrier["home"][:3]) + depth * up).tolist()
    return Robot.model_validate(data)
