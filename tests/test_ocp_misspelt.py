"""A misspelt key of a task file is one line with "did you mean", at every level and before a missing key."""

import pytest

from towline.base.errors import InputError
from towline.ocp import read_task

CIRCLE = {"kind": "circle", "centre": [0, 0, -1], "radius": 0.5, "rate": 0.6}
LINE = {"kind": "line", "start": [0, 0, -1], "end": [0.2, 0, -1]}
BALL = {"kind": "sphere", "centre": [0, 0, 0], "radius": 0.1}


def circle(**other):
    return {"path": CIRCLE, **other}


def without(mapping, key):
    return {name: value for name, value in mapping.items() if name != key}


MISSPELT = {
    "task, required": ({"pth": CIRCLE}, "pth", "path"),
    "task": (circle(durations=3), "durations", "duration"),
    "path, required": (circle(path={**without(CIRCLE, "radius"), "radus": 0.5}), "radus", "radius"),
    "path of another kind": ({"path": {**without(LINE, "start"), "strat": [0, 0, -1]}}, "strat", "start"),
    "path, optional": (circle(path={**CIRCLE, "fram": "world"}), "fram", "frame"),
    "base": (circle(base={"kind": "free", "aceleration_max": 3}), "aceleration_max", "acceleration_max"),
    "base, held": (circle(base={"kind": "hold", "pose": {}}), "pose", "poses"),
    "path of a carrier": (
        circle(base={"kind": "given", "paths": {"quad": {**without(LINE, "end"), "ends": [0, 0, 0]}}}),
        "ends",
        "end",
    ),
    "tube": (circle(tube={"positon": 0.1}), "positon", "position"),
    "limits": (circle(limits={"cable_sped": 1}), "cable_sped", "cable_speed"),
    "range of lengths": (circle(limits={"cable_length": {"mn": 1, "max": 2}}), "mn", "min"),
    "box": (circle(limits={"platform_box": {"min": [0, 0, 0], "mx": [1, 1, 1]}}), "mx", "max"),
    "keep_out": (
        circle(limits={"keep_out": [BALL, {**without(BALL, "centre"), "center": [0, 0, 0]}]}),
        "center",
        "centre",
    ),
    "keep_out, mesh": (
        circle(limits={"keep_out": [{"kind": "mesh", "file": "part.stl", "scal": 0.001}]}),
        "scal",
        "scale",
    ),
    "keep_out, box": (
        circle(limits={"keep_out": [{"kind": "box", "min": [0, 0, 0], "max": [1, 1, 1], "atitude": [0, 0, 1]}]}),
        "atitude",
        "attitude",
    ),
    "soft": (circle(limits={"cable_speed": 1, "soft": {"cable_spede": 0.1}}), "cable_spede", "cable_speed"),
    "objective": (circle(objective={"tensions": 5}), "tensions", "tension"),
    "duration": (circle(duration={"minimum": 1, "max": 2}), "minimum", "min"),
    "wind": (circle(wind={"min": [0, 0, 0], "maxx": [1, 1, 1]}), "maxx", "max"),
}


@pytest.mark.parametrize("case", MISSPELT)
def test_a_misspelt_key_is_named_with_what_was_meant(case):
    task, key, meant = MISSPELT[case]
    with pytest.raises(InputError) as refused:
        read_task(task)
    message = str(refused.value)
    assert "\n" not in message
    assert key in message
    assert f"did you mean {meant!r}" in message or f"did you mean {meant}" in message, message
    assert "missing" not in message
