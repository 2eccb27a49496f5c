"""Where a program starts: at a motion past what the usual guess collides with."""

from functools import partial

import numpy as np

from ..nlp.guess import formation_guess, usual_guess
from ..search.search import Search
from ..tasks.deviation import Deviation
from .global_path import find_global_path
from .need import guess_exceeds, is_open

GLOBAL_SHARE = 0.2  # of the time limit


def motion_past(search: Search, balance: bool) -> tuple[Deviation | None, bool]:
    """Return a motion past what the usual guess collides with, or the best guess, and whether it collides at all.

    None is the usual guess where no formation is better.

    With `balance` a configuration without tensions at rest is a collision.
    """
    scenario = search.scenario
    if scenario.count == 0 or not is_open(scenario):
        return None, False
    with search.stage("global path") as stage:
        usual = partial(usual_guess, scenario)
        exceeded = guess_exceeds(scenario, usual, balance)
        nodes = np.linspace(0.0, scenario.duration, scenario.task.steps + 1)
        formation = formation_guess(scenario) if search.seconds_left > 0 else None
        clear = formation is not None and not guess_exceeds(scenario, formation, balance)
        if not exceeded:
            # A formation keeps more distance, but not between the places at which it was chosen.
            return None if formation is None else (formation if clear else usual)(nodes), False
        if formation is not None and clear:
            stage.message = f"the direct motion exceeds {exceeded}: a shifted or turned one keeps all limits"
            return formation(nodes), True
        seconds = min(GLOBAL_SHARE * scenario.task.time_limit, search.seconds_left)
        path, message = find_global_path(scenario, seconds)
        stage.message = f"the direct motion exceeds {exceeded}: {message}"
        if path is not None:
            return path.guess(scenario), True
        return None if formation is None else formation(nodes), True
