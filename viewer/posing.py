"""Pose a robot by hand: with sliders or handles, hanging on cables of fixed lengths, or at a feasible pose nearby."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..base.errors import InputError, TowlineError
from ..models import Dynamics, Robot, points
from ..statics.equilibria import rest_near
from ..workspace import StaticEquilibrium
from ..workspace.region import nearest_feasible
from .frames import Frames
from .geometry import Geometry
from .labels import link
from .sliders import Slider, Strips, sliders
from .snapshot import Show, at_rest
from .stage import move

if TYPE_CHECKING:
    import viser

HANDLE = 0.13  # of the robot's size
NOTHING = "nothing"


class Posing:
    """The controls of a robot's pose on a viser server.

    - `server`: its panel gets sliders, its scene handles.
    - `frames`: the marks of instants on it.
    - `geometry`: the geometry of the robot.
    - `show`, `refuse`: draw an instant, and show why there is none.
    """

    def __init__(
        self, server: viser.ViserServer, frames: Frames, geometry: Geometry, show: Show, refuse: Callable[[str], None]
    ):
        self._server, self._frames, self._geometry, robot = server, frames, geometry, geometry.robot
        self._robot = robot
        self._show, self._refuse = show, refuse
        self._dynamics, self._settings = Dynamics(robot), sliders(robot, geometry)
        self._busy, self._latest = threading.Lock(), 0
        self._home = home_at_rest(robot)
        self._pose, self._carriers = opening_pose(robot, geometry), robot.carrier_home.copy()
        self._lengths = self._dynamics.cable_lengths(self._pose, self._carriers)
        gui: Any = server.gui
        owners = list(dict.fromkeys(setting.carrier for setting in self._settings))
        names = {owner: "platform" if owner is None else robot.carriers[owner].name for owner in owners}
        self._sliders: list[Any] = []
        self._tracks: list[Any] = []
        for owner in owners:
            name = "Platform" if owner is None else f"Carrier {names[owner]}"
            # Teams of six would fill the screen.
            with gui.add_folder(name, expand_by_default=owner is None or len(owners) < 3):
                for it in self._settings:
                    if it.carrier == owner:
                        self._sliders.append(gui.add_slider(it.label, it.low, it.high, it.step, self._value(it)))
                        self._tracks.append(gui.add_html(""))
        self._strips = Strips(robot, self._settings, self._shade)
        self._hang = gui.add_checkbox(
            "let it hang",
            few_cables(robot),
            disabled=robot.weight == 0,
            hint="Cables keep their lengths, and the platform comes to rest. Moving the platform sets their lengths.",
        )
        nearest = gui.add_button("Nearest feasible pose", disabled=few_cables(robot))
        moved = (self._pose != self._home).any()
        home = gui.add_button("Home", hint="No tensions inside the limits hold the platform there." if moved else None)
        drag = gui.add_dropdown("drag", (*names.values(), NOTHING), initial_value=names[owners[0]])
        self._handles = {owner: self._handle(owner, owner == owners[0]) for owner in owners}
        for slider, setting in zip(self._sliders, self._settings, strict=True):
            slider.on_update(lambda event, it=setting: self._slid(event, it))
        self._hang.on_update(lambda _: self._go(self._pose, self._carriers))
        nearest.on_click(lambda _: self._approach())
        home.on_click(lambda _: self._go(self._home, self._robot.carrier_home))
        self._link = gui.add_html("")

        self._drag, self._names = drag, names
        drag.on_update(lambda _: self._show_handles())
        self._go(self._pose, self._carriers)

    def _show_handles(self) -> None:
        for owner, handle in self._handles.items():
            handle.visible = self._drag.value == self._names[owner]

    @contextmanager
    def without_handles(self) -> Iterator[None]:
        """Hide the handles until the block ends."""
        for handle in self._handles.values():
            handle.visible = False
        try:
            yield
        finally:
            self._show_handles()

    def _handle(self, owner: int | None, visible: bool) -> Any:
        """Return the handle in the scene of the platform (None) or a carrier."""
        free = [it.coordinate for it in self._settings if it.carrier == owner]
        moves = (0 in free, 1 in free, 2 in free)
        handle = self._server.scene.add_transform_controls(
            "/handles/platform" if owner is None else f"/handles/{owner + 1}",
            scale=HANDLE * self._geometry.extent.size,
            active_axes=moves,
            disable_axes=not any(moves),
            disable_sliders=sum(moves) < 2,
            disable_rotations=not any(coordinate > 2 for coordinate in free),
            depth_test=False,
            opacity=0.6,
            visible=visible,
        )
        handle.on_update(lambda event: self._dragged(owner, event))
        return handle

    def _slid(self, event: Any, setting: Slider) -> None:
        if event.client_id is None:  # otherwise `_go` has set it
            return
        pose, carriers = self._pose.copy(), self._carriers.copy()
        (pose if setting.carrier is None else carriers[setting.carrier])[setting.coordinate] = event.target.value
        self._go(pose, carriers, lengthen=setting.carrier is None, held=event.target)

    def _dragged(self, owner: int | None, event: Any) -> None:
        """Move the platform (None) or a carrier to its handle, as far as its sliders reach."""
        pose, carriers = self._pose.copy(), self._carriers.copy()
        place = pose if owner is None else carriers[owner]
        turned = points.angles(Rotation.from_quat(event.target.wxyz, scalar_first=True).as_matrix())
        for setting in self._settings:
            if setting.carrier == owner:
                wanted = [*event.target.position, *turned][setting.coordinate]
                place[setting.coordinate] = min(max(float(wanted), setting.low), setting.high)
        self._go(pose, carriers, lengthen=owner is None, held=None if event.phase == "end" else self._handles[owner])

    def _approach(self) -> None:
        """Go to the feasible pose nearest to this one."""
        found = nearest_feasible(
            self._robot, StaticEquilibrium(), self._pose, self._carriers, self._geometry.extent.size
        )
        if found is None:
            self._refuse("no feasible pose was sampled around this one")
        else:
            self._go(found, self._carriers)

    def _go(self, pose: np.ndarray, carriers: np.ndarray, lengthen: bool = True, held: Any = None) -> None:
        """Show a pose, or where the platform comes to rest near it, in one update of sliders, handles and scene.

        - `pose`, `carriers`: (6,) and (c, 6).
        - `lengthen`: cables take the lengths of this pose; otherwise they keep theirs while "let it hang" is on.
        - `held`: the slider or handle that a user holds. It is not moved, because its next event may be on its way,
          unless it is a slider and the platform hangs elsewhere.

        Sliders and handles agree about a pose that cannot be shown too: the next event begins there.
        """
        if not (np.isfinite(pose).all() and np.isfinite(carriers).all()):  # no page of ours sends that
            return
        self._latest = number = self._latest + 1
        with self._busy:
            if number != self._latest:  # a later call came while this one waited
                return
            refused, instant = "", None
            try:
                if lengthen or not self._hang.value:
                    self._lengths = self._dynamics.cable_lengths(pose, carriers)
                if self._hang.value:
                    pose = at_rest_with(self._robot, self._lengths, pose, carriers)
                instant = at_rest(self._dynamics, self._geometry, pose, carriers)
            except TowlineError as error:
                refused = str(error)
            self._pose, self._carriers = pose.copy(), carriers.copy()
            with self._frames.instant():
                self._link.content = link(self._robot, self._pose, self._carriers)
                for slider, setting in zip(self._sliders, self._settings, strict=True):
                    if slider is not held or self._hang.value:
                        slider.value = self._value(setting)
                for owner, handle in self._handles.items():
                    if handle is not held:
                        move(handle, pose if owner is None else carriers[owner])
                if instant is None:
                    self._refuse(refused)
                else:
                    self._show(instant)
            if self._hang.value:
                self._shade([""] * len(self._tracks))
            else:
                self._strips.want(pose, carriers)

    def open(self, pose: np.ndarray, carriers: np.ndarray) -> None:
        """Move to poses (6,) and (c, 6), as far as the sliders reach."""
        wanted, places = self._pose.copy(), self._carriers.copy()
        for setting in self._settings:
            here, there = (
                (wanted, pose) if setting.carrier is None else (places[setting.carrier], carriers[setting.carrier])
            )
            here[setting.coordinate] = min(max(float(there[setting.coordinate]), setting.low), setting.high)
        self._go(wanted, places)

    def close(self) -> None:
        """Stop shading the sliders."""
        self._strips.close()

    def _shade(self, strips: list[str]) -> None:
        """Show strips below the sliders; none while the platform hangs, because it then rests elsewhere."""
        with self._server.atomic():
            for track, content in zip(self._tracks, strips, strict=True):
                shown = "" if self._hang.value else content
                if track.content != shown:
                    track.content = shown

    def _value(self, setting: Slider) -> float:
        """Return the value of a coordinate inside the range of its slider, with two digits more than its steps."""
        place = self._pose if setting.carrier is None else self._carriers[setting.carrier]
        value = round(float(place[setting.coordinate]), 2 - math.floor(math.log10(setting.step)))
        return min(max(value + 0.0, setting.low), setting.high)


def few_cables(robot: Robot) -> bool:
    """Return whether the cables leave some motion of the platform free, so that it can rest only at certain poses."""
    return robot.m < int(robot.dof_mask.sum()) and robot.weight > 0


def opening_pose(robot: Robot, geometry: Geometry) -> np.ndarray:
    """Return the pose (6,) at which a view opens: `home_at_rest`, or the feasible pose nearest to it.

    If the search finds no feasible pose, it is `home_at_rest`.
    """
    home = home_at_rest(robot)
    if few_cables(robot):
        return home
    found = nearest_feasible(robot, StaticEquilibrium(), home, robot.carrier_home, geometry.extent.size)
    return home if found is None else found


def home_at_rest(robot: Robot) -> np.ndarray:
    """Return the home pose (6,), or where the platform rests near it with its cables, if they are few."""
    lengths = Dynamics(robot).cable_lengths(robot.home, robot.carrier_home)
    rest = rest_near(robot, lengths, robot.home, robot.carrier_home) if few_cables(robot) else None
    return robot.home if rest is None else rest.pose


def at_rest_with(robot: Robot, lengths: np.ndarray, pose: np.ndarray, carriers: np.ndarray) -> np.ndarray:
    """Return the pose (6,) near `pose` (6,) at which the platform rests with cables of `lengths` (m,) [m].

    Raises `InputError` if there is none.
    """
    rest = rest_near(robot, lengths, pose, carriers)
    if rest is None:
        raise InputError("the platform comes to rest nowhere near this pose with cables of these lengths")
    return rest.pose
