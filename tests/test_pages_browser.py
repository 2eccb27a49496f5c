"""Pages of reports in headless Chromium: on a phone nothing is cut, in the dark they are dark, links unfold claims."""

import re
from functools import cache

import numpy as np
import pytest

from towline.figures import page as html, style
from towline.figures.drawing import Drawing
from towline.studies.accounts import files as accounts
from towline.studies.accounts.claim import Account, Chapter, Claim, Paper, Verdict

from .chromium import chromium, watched

PHONE, DESK = {"width": 400, "height": 800}, {"width": 1280, "height": 800}
LEAST_CONTRAST = 4.5  # of text with its background: level AA of WCAG
BEYOND = """() => [...document.querySelectorAll("body *")].filter(
  element => element.getBoundingClientRect().right > window.innerWidth + 0.5 && !element.closest("pre")
).map(element => element.tagName)"""
SCROLLING = """() => [...document.querySelectorAll("table, div, td")].filter(
  element => element.scrollWidth > element.clientWidth + 1
).map(element => element.tagName)"""


@pytest.fixture(scope="module")
def kept_open():
    with chromium() as browser, watched(browser) as (page, wrong):
        yield page
        assert wrong == []


@pytest.fixture
def page(kept_open):
    """The one page of these tests, on a desk."""
    kept_open.goto("about:blank")  # of an address, what a link before added
    kept_open.set_viewport_size(DESK)
    kept_open.emulate_media(color_scheme="light")
    return kept_open


def drawing():
    canvas = style.figure()
    style.axes(canvas, "x [m]", "y [m]").plot([0, 1], [0, 1])
    return Drawing("A plot", canvas)


@cache
def report():
    """A page as a plan has it, with rows that are longer than a phone is wide."""
    rows = [("stage " + "x" * 30, "1.2 m/s^2", "a long text " * 8, *("12 345.67 N",) * 4)] * 3
    heads = ("stage", "status", "what it is about", "t_min", "t_max", "margin", "violation")
    facts = html.facts("Tensions", [("smallest", "1.23 N at t = 1.234 s, cable 3"), ("", "and " + "y" * 60)])
    parts = [
        facts,
        html.columns("Stages", heads, rows),
        html.picture(drawing()),
        html.fold("A file", html.verbatim("z" * 300)),
    ]
    return html.page("A plan", "feasible", "margin 1.2 N", style.colour(0), parts)


@cache
def account():
    """The page of an account with as many claims as those of the papers have."""
    words = ("Eq. 12", "the wrench matrix has the rank 6 at every pose of the workspace " * 2, None, "rank 5")
    claims = [
        Claim(f"claim.{k}", *words, list(Verdict)[k % 4], "it has rank 5 where two cables are parallel", figure="plot")
        for k in range(80)
    ]
    chapters = {f"Chapter {k}": Chapter(claims[20 * k : 20 * k + 20], {"plot": drawing()}) for k in range(4)}
    return accounts.page(Account(Paper("name", "A paper"), chapters, {"Broken": "the solver failed"}, 1.0))


@pytest.mark.parametrize("make", [report, account])
def test_nothing_is_cut_on_a_phone(make, page):
    page.set_viewport_size(PHONE)
    page.set_content(make())
    page.evaluate("() => document.querySelectorAll('details').forEach(one => { one.open = true })")
    assert page.evaluate("() => document.documentElement.scrollWidth") <= PHONE["width"]
    assert page.evaluate(BEYOND) == []
    assert page.evaluate(SCROLLING) == []


@pytest.mark.parametrize("make", [report, account])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_is_legible_in_either_scheme(make, scheme, page):
    page.emulate_media(color_scheme=scheme)
    page.set_content(make())
    paper = luminance(page, "body", "backgroundColor")
    assert paper < 0.05 if scheme == "dark" else paper > 0.9
    for selector in ("p", "td", "th", "figcaption", "summary", "footer", *(["a"] if make is account else [])):
        ink = luminance(page, selector, "color")
        light, dark = max(ink, paper), min(ink, paper)
        assert (light + 0.05) / (dark + 0.05) >= LEAST_CONTRAST, selector


def luminance(page, selector, colour):
    """Return the relative luminance of a colour of the first element, 0 to 1."""
    text = page.evaluate("([one, of]) => getComputedStyle(document.querySelector(one))[of]", [selector, colour])
    parts = np.array([float(part) / 255 for part in re.findall(r"[\d.]+", text)[:3]])
    return float(np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722])


def test_a_link_leads_to_its_claim_and_unfolds_it(page):
    page.set_content(account())
    entry = page.locator("#errata a").first
    target = page.locator(f'[id="{entry.get_attribute("href")[1:]}"]')
    assert not target.is_visible()
    entry.click()
    target.wait_for(state="visible", timeout=5000)
    assert "it has rank 5" in target.inner_text()
    hrefs = page.evaluate("() => [...document.querySelectorAll('a')].map(one => one.getAttribute('href').slice(1))")
    assert all(page.evaluate("id => document.getElementById(id) !== null", href) for href in hrefs)


def test_eighty_claims_are_a_page_that_can_be_overlooked(page):
    page.set_content(account())
    assert page.evaluate("() => document.documentElement.scrollHeight") < 15 * 800
