"""Plans without the changes that they offer, whose search takes longer than most plans, and reports of them."""

from dataclasses import replace

from towline.ocp.plan import Plan
from towline.ocp.result import Offers


def without_offers(found: Plan) -> Plan:
    """Return a plan that offers no changes."""
    return replace(found, offers=Offers)


def told(found: Plan) -> str:
    """Return the report of a plan, with no changes offered."""
    return without_offers(found).report()
