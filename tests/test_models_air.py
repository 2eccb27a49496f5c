"""Winds: bounds, seeds, and the statistics that the Dryden model states."""

import numpy as np
import pytest
from scipy.signal import welch

from towline.base.errors import InputError
from towline.models import air

TIMES = np.linspace(0, 10, 1001)


def test_trapezoid_stays_inside_its_noise_and_is_seeded():
    wind = air.trapezoid(TIMES, seed=3)
    assert wind.shape == (1001, 3)
    steady = (TIMES > 3.1) & (TIMES < 6.9)
    assert (np.abs(wind[steady] - [5, 6, 2]) <= 0.5 + 1e-12).all()
    assert (np.abs(wind[TIMES < 0.9]) <= 0.5).all()
    np.testing.assert_array_equal(wind, air.trapezoid(TIMES, seed=3))
    assert not np.array_equal(wind, air.trapezoid(TIMES, seed=4))
    np.testing.assert_array_equal(air.trapezoid(TIMES, noise=0)[500], [5, 6, 2])


def test_dryden_has_the_stated_spectrum():
    """Variance sigma^2 and MIL-F-8785C's spectra along and across, by Welch's method on a long record."""
    step, speed = 0.05, 5.0
    times = np.arange(400_000) * step
    sigma, scale = np.array([1.0, 0.8, 0.5]), np.array([20.0, 15.0, 10.0])
    gusts = air.dryden(times, [speed, 0, 0], sigma, scale, seed=1) - [speed, 0, 0]
    np.testing.assert_allclose(gusts.var(axis=0), sigma**2, rtol=0.1)
    frequency, density = welch(gusts, fs=1 / step, nperseg=4096, axis=0)
    band = (frequency > 0.02) & (frequency < 1.0)
    omega = 2 * np.pi * frequency[band]
    for axis in range(3):
        T = scale[axis] / speed
        if axis == 0:
            two_sided = sigma[axis] ** 2 * 2 * T / (1 + (T * omega) ** 2)
        else:
            two_sided = sigma[axis] ** 2 * T * (1 + 3 * (T * omega) ** 2) / (1 + (T * omega) ** 2) ** 2
        ratio = density[band, axis] / (2 * two_sided)
        assert np.median(ratio) == pytest.approx(1, abs=0.05)
        assert np.percentile(ratio, 5) > 0.7
        assert np.percentile(ratio, 95) < 1.4


def test_dryden_turns_with_the_wind():
    times = np.arange(200_000) * 0.05
    gusts = air.dryden(times, [0, 4, 0], (1.0, 0.5, 0.2), (10, 10, 10), seed=2)
    np.testing.assert_allclose(gusts.std(axis=0), [0.5, 1.0, 0.2], rtol=0.1)
    assert gusts[:, 1].mean() == pytest.approx(4, abs=0.1)


def test_constant():
    np.testing.assert_array_equal(air.constant(TIMES, [1, 2, 3])[[0, -1]], [[1, 2, 3], [1, 2, 3]])


def test_wrong_winds_are_named():
    with pytest.raises(InputError, match=r"mean must be .* with a horizontal part"):
        air.dryden(TIMES, [0, 0, 1])
    with pytest.raises(InputError, match="times must increase in equal steps"):
        air.dryden(TIMES**2, [1, 0, 0])
    with pytest.raises(InputError, match="corners"):
        air.trapezoid(TIMES, corners=(0.5, 0.1, 0.7, 0.9))


def test_dryden_at_small_steps_and_slow_winds():
    """A millisecond in a slow wind of large scale: the innovation is tiny, not lost."""
    times = np.arange(2000) * 1e-3
    for mean, scale in (([0.3, 0, 0], (200, 200, 50)), ([1, 0, 0], (533, 533, 533))):
        ensemble = np.stack([air.dryden(times, mean, scale=scale, seed=seed) - mean for seed in range(400)])
        np.testing.assert_allclose(ensemble[:, [0, -1]].std(axis=0), [[1, 1, 0.5]] * 2, rtol=0.12)
        assert np.abs(np.diff(ensemble, axis=1)).max() < 0.5  # smooth at that scale


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"scale": (0, 1, 1)}, "scale"),
        ({"intensity": (1, 1)}, "intensity"),
        ({"mean": (1, np.nan, 0)}, "mean"),
        ({"mean": (1, 2)}, "mean"),
        ({"times": "now"}, "times"),
        ({"times": [np.nan, 1, 2]}, "times"),
    ],
)
def test_wrong_arguments_of_dryden_are_named(arguments, field):
    with pytest.raises(InputError, match=f"^{field}"):
        air.dryden(**{"times": TIMES, "mean": (1, 0, 0), **arguments})


def test_wrong_arguments_of_the_others_are_named():
    for function, arguments, field in (
        (air.constant, (TIMES, (1, 2)), "velocity"),
        (air.trapezoid, ([],), "times"),
        (air.trapezoid, (TIMES[::-1],), "times"),
        (air.trapezoid, (TIMES, (1, 2)), "peak"),
        (air.trapezoid, (TIMES, (1, 2, 3), (0, 0.5, 1, 2)), "corners"),
        (air.trapezoid, (TIMES, (1, 2, 3), (0, 0.2, 0.5, 1), -1), "noise"),
    ):
        with pytest.raises(InputError, match=f"^{field}"):
            function(*arguments)
