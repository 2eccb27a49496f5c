"""The errata of an account as Markdown."""

import re

from .account import Account
from .claim import Claim, Verdict, value_text

BY_THE_PAPER = "By the paper"  # head of what it prints, or of what follows from that
MEANING = "“By the paper” marks what the paper prints, or what follows from it."
COMPARED = re.compile(r"(?P<statement>.*\S) \((?P<quantity>.*)\)\.", re.DOTALL)  # what the numbers of a claim are
READ = (
    "The paper was read as text recognised from its pages (OCR): a single wrong symbol may be an error of the "
    "recognition, not of the authors."
)


def errata(account: Account) -> str:
    """Return the claims that were not reproduced, by verdict, with their reasons."""
    lines = [
        f"# Errata of {account.paper.source}",
        "",
        "Each entry gives a claim of the paper, the values that were compared, and why the claim is not reproduced. "
        f"{MEANING} {READ}",
    ]
    titles = {
        Verdict.DIFFERS: "Printed results that differ, and what is correct",
        Verdict.IMPOSSIBLE: "Impossible",
        Verdict.NOT_DETERMINED: "Not determined by what the paper prints",
        Verdict.REPAIRED: "What is possible instead",
    }
    for verdict, title in titles.items():
        entries = [_entry(claim) for claim in account.errata if claim.verdict is verdict]
        lines += ["", f"## {title}", *entries] if entries else []
    return "\n".join([*lines, ""])


def numbers_text(claim: Claim) -> str:
    """Return what the paper gives and what was computed, in a sentence each."""
    numbers = ((BY_THE_PAPER, claim.printed), ("Computed", claim.computed))
    return " ".join(f"{head}: {value_text(value, claim.unit)}." for head, value in numbers if value is not None)


def _entry(claim: Claim) -> str:
    """Return the place and the name of a claim with what it states, the two numbers, and why: one paragraph each."""
    found = COMPARED.fullmatch(claim.statement)
    statement, quantity = (f"{found['statement']}.", found["quantity"]) if found else (claim.statement, "")
    about = f"*Compared: {quantity}.* " if quantity else ""
    parts = [f"- **{claim.place}** (`{claim.id}`): {statement}", f"{about}{numbers_text(claim)}".strip(), claim.why]
    safe = [part.replace("<", "&lt;").replace("\n", " ") for part in parts]
    return "\n" + "\n\n    ".join(safe)
