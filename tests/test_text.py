"""Numbers that people read."""

import math

import numpy as np
import pytest

from towline.base.text import at_most, column, counted, numbered, quantity, quantity_range, quantity_row, unbroken

WRITTEN = [
    (10337.2, "10 340"),
    (1034.0, "1034"),
    (9999.9, "10 000"),
    (1_234_567.0, "1 235 000"),
    (0.734112, "0.7341"),
    (2.0, "2"),
    (-12.50, "-12.5"),
    (0.001, "0.001"),
    (0.00123456, "0.001235"),
    (0.0009999999, "0.001"),
    (1.23e-5, "1.23e-5"),
    (1.2e7, "1.2e7"),
    (9_999_999.0, "1e7"),
    (-1e-17, "0"),
    (-0.0, "0"),
    (100.0, "100"),
    (math.nan, "-"),
    (None, "-"),
    (math.inf, "inf"),
    (-math.inf, "-inf"),
    (12_345_678, "12 345 678"),
    (7, "7"),
    (np.float32(0.5), "0.5"),
    (np.int64(20000), "20 000"),
    (np.array(3.25), "3.25"),
]


@pytest.mark.parametrize(("value", "text"), WRITTEN)
def test_a_quantity_is_plain(value, text):
    assert quantity(value) == text


WITH_UNITS = [
    (10337.2, "N", "10 340 N"),
    (5.171e-7, "N", "0.52 uN"),
    (-5.171e-7, "N", "-0.52 uN"),
    (1e-6, "N", "1 uN"),
    (0.0009999999, "m", "0.001 m"),
    (4.2e-4, "N m", "0.42 mN m"),
    (1.326e-7, "mrad", "0.13 nrad"),
    (3e-5, "mm", "30 nm"),
    (2e-4, "kg m^2", "0.2 g m^2"),
    (1e-12, "N", "0 N"),
    (1.369e-11, "N", "0 N"),
    (0.0, "N", "0 N"),
    (1.2e7, "N", "12 MN"),
    (2.5e8, "N/m", "250 MN/m"),
    (2e-4, "m/s^2", "0.2 mm/s^2"),
    (2.5e-5, "m^3", "25 cm^3"),
    (20_000_000, "samples", "20 000 000 samples"),
    (math.nan, "N", "-"),
    (math.inf, "N", "inf N"),
]


@pytest.mark.parametrize(("value", "unit", "text"), WITH_UNITS)
def test_a_unit_takes_a_prefix_instead_of_an_exponent(value, unit, text):
    assert quantity(value, unit) == text


@pytest.mark.parametrize("unit", ["N", "mm", "mrad", "N m", "m/s", "kg"])
def test_with_a_unit_no_number_has_an_exponent(unit):
    for value in 10 ** np.random.default_rng(0).uniform(-20, 12, 500):
        number, prefixed = quantity(value, unit).rsplit(" ", unit.count(" ") + 1)[:2]
        assert "e" not in number
        assert prefixed


def test_no_exponent_and_no_signed_zero_where_none_is_needed():
    rng = np.random.default_rng(0)
    values = rng.choice([-1, 1], 2000) * 10 ** rng.uniform(-3, 6.999, 2000)
    for value in values:
        text = quantity(value)
        assert "e" not in text
        assert float(text.replace(" ", "")) == pytest.approx(value, rel=5.1e-4)
        assert all(float(cell.replace(" ", "")) != 0 or cell[0] != "-" for cell in column([value, -1e-5, -1e-9]))


def test_rows_and_ranges_have_their_unit_once():
    assert quantity_row([1, 2.5, 10337.2], "N") == "1, 2.5, 10 340 N"
    assert quantity_row([], "N") == ""
    assert quantity_row([1e-5, -3e-9, 250.0], "N") == "0.00001, 0, 250 N"
    assert quantity_row([1e-5, 2e-5], "N") == "10, 20 uN"
    assert quantity_range([1e-9, 2e-6], "N") == "0.001 to 2 uN"
    assert quantity_range(np.array([30.0, 2.0, math.nan]), "N") == "2 to 30 N"
    assert quantity_range([5.0, 5.0 + 1e-9], "N") == "5 N"
    assert quantity_range([None, math.nan], "N") == "-"


def test_a_column_has_equally_many_decimals():
    assert column([1.0, 20.125, -1e-9]) == ["1.00", "20.12", "0.00"]
    assert column([12345.6, 1.0, None, math.inf]) == ["12 346", "1", "-", "inf"]
    assert column([0.0, 0.0]) == ["0", "0"]


def test_one_thing_has_no_plural():
    assert [counted(count, "cable") for count in (0, 1, 2)] == ["0 cables", "1 cable", "2 cables"]
    assert counted(np.int64(1), "more error") == "1 more error"
    assert numbered("cable", np.array([2])) == "cable 3"
    assert numbered("cable", (0, 4)) == "cables 1, 5"


def test_errors_below_their_resolution_have_no_digits():
    assert at_most(0.00237, "mm", 0.01) == "under 0.01 mm"
    assert at_most(12.3456, "mm", 0.01) == "at most 12.3 mm"
    assert at_most(math.nan, "mm", 0.01) == "at most -"


@pytest.mark.parametrize(
    ("text", "joined"),
    [
        ("10 340 N in cable 3 at t = 1.000 s", "10~340~N in cable 3 at t~=~1.000~s"),
        ("5 N m, 2 kg m^2, 3.5 m/s^2, 1 uN", "5~N~m, 2~kg~m^2, 3.5~m/s^2, 1~uN"),
        ("95 % of 20 robots, tilted by 12 degrees", "95~% of 20 robots, tilted by 12~degrees"),
        ("cable 3 must have 4 stages", "cable 3 must have 4 stages"),
    ],
)
def test_a_number_and_its_unit_stay_on_one_line(text, joined):
    assert unbroken(text) == joined.replace("~", "\u00a0")
