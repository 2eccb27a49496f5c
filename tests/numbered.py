"""What both papers number, and which of these numbers the place of a claim names."""

import re
from pathlib import Path

PAPERS = Path(__file__).parent.parent.parent / "shared" / "papers"
TEXTS = {"flying": PAPERS / "flying-cdpr.txt", "ctmrts": PAPERS / "ctmrts.txt"}
NUMBERED = {
    "flying": {"Eq.": range(1, 39), "figure": range(1, 16), "Table": (1,), "step": range(1, 9)},
    "ctmrts": {"Eq.": range(1, 18), "figure": range(1, 7), "Table": (1,), "step": "abcdefg"},
}
IN_THE_TEXT = {"Eq.": r"\\quad \((\d+)\)\$\$", "figure": r"^Fig\. (\d+)\.", "Table": r"^Table (\d+)"}
STEPS = {"flying": r"^- (\d)\) ", "ctmrts": r"^(?:- )?\(([a-g])\) "}
NAMED = {"Eq.": r"Eqs?\.", "figure": "figures?", "Table": "Table", "step": "steps?"}


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
