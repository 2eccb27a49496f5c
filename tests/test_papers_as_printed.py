"""What claims state that the papers print, looked up in their texts: a claim must not rest on a misreading."""

import re

import pytest

from towline.studies.flying import references
from towline.studies.towing.equations import MEANT

from .numbered import TEXTS


@pytest.fixture(scope="module")
def texts():
    if not all(path.exists() for path in TEXTS.values()):
        pytest.skip("the texts of the papers are not here")
    return {name: " ".join(path.read_text().split()) for name, path in TEXTS.items()}


def equation(text, number):
    """Return the equation with a number, from the dollars before it."""
    return text[: text.index(rf"\quad ({number})$$")].rpartition("$$")[2]


@pytest.mark.parametrize(
    "printed",
    [
        r"(\mathbf{T} + \Delta \mathbf{T}) + \mathbf{F}_e \quad (24)$$",  # eq-24
        r"\sin \mu = 0$, $\cos \mu = 1$",  # eq-9-small
        r"\Delta \theta_B = [\Delta \phi_B \ \Delta \theta_B \ \Delta \varphi_B]^T",  # eq-8: changes of the angles
        r"_{3 \times 6} (T' + F') + M_e",  # eq-33-right
        r"\mathbf{b}_i = [r_B \cos((i-1)\alpha_A)",  # eq-3-alpha
        r"($i=1,2,\dots,n+1$)",  # eq-23-cables
        r"angular acceleration of {B} relative to {G} in {B}",  # eq-32-frame
        r"horizontal circular motion in $\{B\}$",  # frames
        r"horizontal circle motion in $\{B\}$",
        r"position vector in $\{A\}$ is: $\mathbf{X}_a",
        r"moving platform in $\{B\}$ is: $\mathbf{X}_b",
        r"[\mathbf{k}_5 \quad \mathbf{k}_6]_{6 \times 1}^T",  # eq-18-size
        r"2 {}^G \mathbf{R}_A \bar{\mathbf{x}}_b",  # eq-26
    ],
)
def test_paper_f_prints(texts, printed):
    assert printed in texts["flying"], printed


@pytest.mark.parametrize(
    "printed",
    [
        "By Eq. (3), the cable tension can be expressed",  # equation-references
        "special solution for Eq. (3)",
        "meets Eq. (12), if it is and records the position",  # step-f
        "can be obtained using the Eq. (18)",  # step-e
        r"{}^o\mathbf{R}_p \times ({}^o\mathbf{P}_i - \mathbf{b}_i)",  # eq-6-second
        r"$\lambda (\lambda \in (0,1))$ is any scalar",  # eq-17-lambda
        "the range of values for Z is (0.6, 1.38)",  # range-W1-greatest-height
        "in the Z direction is (1m, 1.4m)",
        r"the maximum tension of cable $T_{\text{fmax}}=500\text{N}$",
    ],
)
def test_paper_c_prints(texts, printed):
    assert printed in texts["ctmrts"], printed


def test_numbers_of_equations_by_what_they_are(texts):
    assert r"\mathbf{J}\mathbf{T} + \mathbf{G}" in equation(texts["ctmrts"], int(MEANT["the dynamic equations"]))
    assert r"0 < T_i < T_{f\max}" in equation(texts["ctmrts"], int(MEANT["the bounds of the tensions"]))
    assert r"\ddot{\mathbf{X}} = [" in equation(texts["ctmrts"], 12)


def test_the_recognised_text_has_no_section_vi_c(texts):
    """After 12.47 % come the captions of figures 8 to 15, and then the conclusion."""
    _, _, after = texts["flying"].partition("which is considerable.")
    between, _, _ = after.partition("VII. CONCLUSION")
    assert set(re.findall(r"Fig\. (\d+)\.", between)) == {str(number) for number in range(8, 16)}
    assert len(between) < 700
    assert not re.search(r"\bC\. ", between)


def test_references_of_paper_f_as_printed(texts):
    """Numbers in brackets between sections II and V that are no tags, and figures that VI.A and VI.B name."""
    text = texts["flying"]
    inside = text[text.index("II. KINEMATIC") : text.index("V. THE PROCESS")]
    free = re.sub(r"\\quad \(\d+\)\$\$|\\tag\{\d+\}", " ", inside)
    named = tuple(int(number) for number in re.findall(r"(?<![\w\[\]_^}])\((\d+)\)", free))
    assert named == references.OUTSIDE
    steps = text[text.index("V. THE PROCESS") : text.index("VI. SIMULATION")]
    assert tuple(int(number) for number in re.findall(r"(?<!\d)\((\d+)\)", steps)) == references.IN_STEPS
    examples = text[text.index("A. Cable length and cable tension calculation") : text.index("which is considerable")]
    in_text = re.sub(r"Fig\. \d+\. ", "", examples)
    shown = [int(number) for number in re.findall(r"[Ff]ig(?:ure|\.) (\d+)", in_text)]
    assert shown == [6, *(number for _, number in references.FIGURES.values())]  # the first, 6 (a), is right
    for number, words in ((6, "trajectories"), (7, "cable length and cable tension"), (10, "force"), (11, "ratio")):
        assert words in re.search(rf"Fig\. {number}\. (.{{0,80}})", text)[1], number
