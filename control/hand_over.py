"""`agree`: hand a command over from one controller to another of the same robot."""

from .computed_torque import ComputedTorque


def agree(controller: ComputedTorque, sender: ComputedTorque) -> None:
    """Let a controller take over the command that another one of the same robot has sent, as if it were its own."""
    controller._cables["last"], controller._actuation[:] = sender._cables["last"], sender._actuation
    controller._last, controller._accelerations = sender._last, sender._accelerations
    controller._platform["attitude"] = sender._platform["attitude"]
    controller._of_carriers["ordered"] = sender._of_carriers["ordered"]
    if sender._lead is not None and controller._lead is not None:
        controller._lead.agree(sender._lead)
