"""Reports of plans without the changes that they offer, whose search takes longer than most plans."""

from dataclasses import replace

from towline.ocp.plan import Plan
from towline.ocp.result import Offers


def told(found: Plan) -> str:
    """Return the report of a plan, with no changes offered."""
    return replace(found, offers=Offers).report()
