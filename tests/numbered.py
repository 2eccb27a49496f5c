"""What both papers number, which of these numbers the place of a claim names, and where the errata have a claim."""

import re
from pathlib import Path

from towline.studies.accounts.claim import Verdict

PAPERS = Path(__file__).parent.parent.parent / "shared" / "papers"
TEXTS = {"flying": PAPERS / "flying-cdpr.txt", "ctmrts": PAPERS / "ctmrts.txt"}
NUMBERED = {
    "flying": {"Eq.": range(1, 39), "figure": range(1, 16), "Table": (1,), "step": range(1, 9)},
    "ctmrts": {"Eq.": range(1, 18), "figure": range(1, 7), "Table": (1,), "step": "abcdefg"},
}
IN_THE_TEXT = {"Eq.": r"\\quad \((\d+)\)\$\$", "figure": r"^Fig\. (\d+)\.", "Table": r"^Table (\d+)"}
STEPS = {"flying": r"^- (\d)\) ", "ctmrts": r"^(?:- )?\(([a-g])\) "}
NAMED = {"Eq.": r"Eqs?\.", "figure": "figures?", "Table": "Table", "step": "steps?"}

ERRATA = Path(__file__).parent.parent / "docs" / "errata"
SECTIONS = {
    Verdict.REPRODUCED: [],
    Verdict.DIFFERS: ["Printed results that differ, and what is correct"],
    Verdict.IMPOSSIBLE: ["Impossible"],
    Verdict.NOT_DETERMINED: ["Not determined by what the paper prints"],
    Verdict.REPAIRED: ["What is possible instead"],
}


def numbers_of(place, kind):
    """Numbers and letters that a place of a claim names one by one: a range does not name what is inside it."""
    lists = re.findall(rf"\b{NAMED[kind]} ((?:(?:\d+|\([a-g]\))(?:, | and )?)+)", place)
    return {number.strip("()") for part in lists for number in re.findall(r"\d+|\([a-g]\)", part)}


def unnamed(paper, places):
    """Numbers of a paper that none of the places names, and names of numbers that it does not have."""
    differences = {}
    for kind, numbers in NUMBERED[paper].items():
        named = set().union(*(numbers_of(place, kind) for place in places))
        differences[kind] = named ^ {str(number) for number in numbers}
    return {kind: odd for kind, odd in differences.items() if odd}


def misplaced(paper, verdicts):
    """Claims that the page of errata does not have in the section of their verdict; if any, run `make errata`."""
    sections = [part.partition("\n") for part in (ERRATA / f"{paper}.md").read_text().split("\n## ")]
    places = {name: [title for title, _, text in sections if f"(`{name}`):" in text] for name in verdicts}
    return {name: places[name] for name, verdict in verdicts.items() if places[name] != SECTIONS[verdict]}
