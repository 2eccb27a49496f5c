"""Samplers and `sample`: who computes what does not matter, volumes that are known, wrong input."""

import numpy as np
import pytest
import xarray as xr
from scipy.stats import qmc

from towline.base import processors
from towline.base.errors import InputError
from towline.models import Dynamics, Robot, load
from towline.workspace import Places, Region, StaticEquilibrium, sample, save
from towline.workspace.domain import Domain
from towline.workspace.sampling import CHUNK, Sampler, cells_of

from .framed import framed

REST = StaticEquilibrium()
HEIGHT, RADIUS = 3.0, 2.0
AREA = 3 * np.sqrt(3) / 4 * RADIUS**2  # of the triangle of the anchors
BOX = {"min": [-2, -2, 0], "max": [2, 2, 1]}


def hanging_mass():
    """A point mass on three cables, whose anchors are level: it rests anywhere inside the prism below them."""
    angles = np.array([0, 2, 4]) * np.pi / 3
    ends = [([RADIUS * np.cos(a), RADIUS * np.sin(a), HEIGHT], [0, 0, 0]) for a in angles]
    return framed(ends, {"mass": 1, "dof": ["x", "y", "z"], "home": [0, 0, 1, 0, 0, 0]})


def towed_body():
    """A body on three cables, one from each of three robots that drive."""
    angles = np.array([0, 2, 4]) * np.pi / 3
    return Robot.model_validate(
        {
            "name": "towed",
            "source": "a test",
            "platform": {"mass": 1, "inertia": [0.1, 0.1, 0.1, 0, 0, 0], "home": [0, 0, 0, 0, 0, 0]},
            "carriers": [
                {
                    "name": f"robot-{i}",
                    "kind": "mobile",
                    "home": [np.cos(a), np.sin(a), 1, 0, 0, 0.3],
                    "reach": {
                        "min": [np.cos(a) - 0.1, np.sin(a) - 0.2, 0.9],
                        "max": [np.cos(a) + 0.1, np.sin(a) + 0.2, 1.1],
                    },
                    "speed_max": 1,
                    "acceleration_max": 1,
                }
                for i, a in enumerate(angles)
            ],
            "cables": [
                {
                    "carrier": f"robot-{i}",
                    "anchor": [0.05, 0.02, 0],
                    "attachment": [0.1 * np.cos(a), 0.1 * np.sin(a), 0.02],
                    "t_min": 0,
                    "t_max": 100,
                }
                for i, a in enumerate(angles)
            ],
        }
    )


@pytest.mark.parametrize("method", ["random", "sobol", "grid"])
def test_chunks_are_the_same_in_any_order(method):
    sampler = Sampler(method, 4 * CHUNK + 100, 7, (1.0, 2.0, 0.5))
    forth = [sampler.units(chunk) for chunk in range(5)]
    back = [sampler.units(chunk) for chunk in reversed(range(5))][::-1]
    for one, other in zip(forth, back, strict=True):
        np.testing.assert_array_equal(one, other)
    points = np.vstack(forth)
    assert len(points) == sampler.samples <= 4 * CHUNK + 100
    assert len(np.unique(points, axis=0)) == len(points)
    assert 0 <= points.min() < points.max() < 1
    np.testing.assert_allclose(points.mean(axis=0), 0.5, atol=0.01)


def test_sobol_is_scipys():
    sampler = Sampler("sobol", 3 * CHUNK, 3, (1.0, 1.0))
    sampler.units(0)
    want = qmc.Sobol(2, bits=32, rng=3).random(4 * CHUNK)[2 * CHUNK : 3 * CHUNK]
    np.testing.assert_array_equal(sampler.units(2), want)


def test_random_streams_are_apart():
    one, other = (Sampler("random", 2 * CHUNK, seed, (1.0,)) for seed in (0, 1))
    streams = np.hstack([one.units(0), one.units(1), other.units(0)])
    assert np.abs(np.corrcoef(streams.T) - np.eye(3)).max() < 0.03


def test_cells_of_a_grid_are_about_cubes():
    assert cells_of(np.array([1.0, 1.0, 1.0]), 1000) == (10, 10, 10)
    assert cells_of(np.array([8.0, 2.0, 1e-3]), 400) == (40, 10, 1)
    assert cells_of(np.array([2.0, 1.0]), 1) == (1, 1)


@pytest.mark.parametrize("method", ["random", "sobol", "grid", "adaptive"])
def test_the_prism_below_three_anchors(method):
    found = sample(hanging_mass(), REST, {"position": BOX}, 40_000, method)
    low, high = found["volume_interval"].values
    if method == "grid":
        assert np.isnan([low, high]).all()  # no chance, no interval
    else:
        assert low < AREA < high
    within = {"random": 0.04, "grid": 0.02, "adaptive": 0.02, "sobol": 0.006}[method]
    assert float(found["volume"]) == pytest.approx(AREA, rel=within)
    assert found["volume"].units == "m^3"
    x, y = found["position"].values[:, :2].T
    # Inside of the three edges, each at half the radius from the middle.
    for angle in np.array([1, 3, 5]) * np.pi / 3:
        assert (x * np.cos(angle) + y * np.sin(angle)).max() <= RADIUS / 2 + 1e-9
    assert found["bounds"].values[0, 0] == pytest.approx(-RADIUS / 2, abs=0.08)
    assert found["tried"].sum() == found.attrs["samples"]
    assert found["reached"].sum() == found.attrs["accepted"] == found.sizes["point"]


def test_refinement_reaches_the_size_and_covers_the_boundary():
    found = sample(hanging_mass(), REST, {"position": BOX}, 10**6, "adaptive", size=0.04)
    assert found["cell_edges"].max() <= 0.04
    low, high = found["volume_interval"].values
    assert low < AREA < high
    # Its cells are where an edge of the triangle is, and all along it.
    x, y = found["boundary"].values[:, :2].T
    away = [x * np.cos(a) + y * np.sin(a) - RADIUS / 2 for a in np.array([1, 3, 5]) * np.pi / 3]
    assert np.abs(np.max(away, axis=0)).max() < 0.04 * np.sqrt(2)
    perimeter = 3 * np.sqrt(3) * RADIUS
    assert (high - low) / 0.04 < 3 * perimeter


def test_a_slice_has_an_area():
    found = sample(hanging_mass(), REST, {"position": {"min": [-2, -2, 1], "max": [2, 2, 1]}}, 20_000, "sobol")
    assert found["volume"].units == "m^2"
    assert float(found["volume"]) == pytest.approx(AREA, rel=0.01)
    assert found.sizes["z"] == 1


def test_positions_that_follow_from_lengths():
    """Each cable of a sampled place is as long as it was told, wherever the robots drove; the lower of the two."""
    robot = towed_body()
    region = Region.model_validate(
        {"carriers": "reach", "lengths": {"min": 0.9, "max": 1.3}, "attitude": {"min": [-0.2] * 3, "max": [0.2] * 3}}
    )
    domain = Domain.of(robot, region)
    units = np.random.default_rng(0).random((500, len(domain.extent)))
    places, exists = domain.places(units)
    assert 100 < exists.sum() <= 500
    lengths = Dynamics(robot).cable_lengths(places.pose, places.carriers)
    np.testing.assert_allclose(lengths[exists], (0.9 + 0.4 * units[:, -3:])[exists], rtol=1e-9)
    low, high = domain.box
    assert ((places.pose[exists, :3] >= low) & (places.pose[exists, :3] <= high)).all()
    assert (places.pose[exists, 2] < places.carriers[exists, :, 2].mean(axis=1)).all()
    for carrier, at in zip(robot.carriers, np.moveaxis(places.carriers, 1, 0), strict=True):
        assert (at[:, :3] >= carrier.reach.min).all()
        assert (at[:, :3] <= carrier.reach.max).all()
        np.testing.assert_array_equal(at[:, 3:], np.tile(carrier.home[3:], (500, 1)))


def test_two_workers_find_the_same_to_the_last_bit(tmp_path):
    robot = load("wang-flying")
    region = {"attitude": {"min": [-0.1, -0.1, 0], "max": [0.1, 0.1, 0.1]}}
    told = []
    alone = sample(robot, REST, region, 70_000, keep="all", points_max=50_000)
    both = sample(
        robot, REST, region, 70_000, keep="all", points_max=50_000, workers=2, progress=lambda *at: told.append(at)
    )
    files = [save(found, tmp_path / f"{i}.nc").read_bytes() for i, found in enumerate((alone, both))]
    assert files[0] == files[1]
    assert [done for done, _, _ in told] == [CHUNK, 2 * CHUNK, 3 * CHUNK, 4 * CHUNK, 70_000]
    assert told[-1] == (70_000, 70_000, alone.attrs["accepted"])
    read = xr.load_dataset(tmp_path / "1.nc")
    assert read.sizes["point"] == 50_000
    # The kept ones are what they are said to be.
    pose = np.hstack([read["position"].values, read["attitude"].values])[:2000]
    carriers = np.tile(robot.carrier_home, (2000, 1, 1))
    np.testing.assert_array_equal(REST.holds(robot, Places(pose, carriers)), read["accepted"].values[:2000])


def test_a_zarr_folder_has_the_same_as_the_file(tmp_path):
    pytest.importorskip("zarr")
    found = sample(hanging_mass(), REST, {"position": BOX}, 20_000, keep="all")
    in_file = xr.load_dataset(save(found, tmp_path / "found.nc"))
    folder = save(found, tmp_path / "found.zarr")
    xr.testing.assert_identical(xr.open_zarr(folder).load(), in_file)
    with pytest.raises(InputError, match="must be a new path"):
        save(found, folder)


def test_what_is_kept():
    robot = hanging_mass()
    found = {keep: sample(robot, REST, {"position": BOX}, 20_000, keep=keep) for keep in ("all", "accepted", "none")}
    every = found["all"]
    np.testing.assert_array_equal(
        every["position"].values[every["accepted"].values.astype(bool)], found["accepted"]["position"].values
    )
    assert every.sizes["point"] == 20_000
    assert "position" not in found["none"]
    assert found["none"]["volume"] == every["volume"]
    few = sample(robot, REST, {"position": BOX}, 20_000, points_max=10)
    np.testing.assert_array_equal(few["position"], found["accepted"]["position"][:10])
    assert few.attrs["accepted"] == every.attrs["accepted"]


def test_nothing_accepted_is_an_answer():
    found = sample(hanging_mass(), REST, {"position": {"min": [5, 5, 0], "max": [6, 6, 1]}}, 1000)
    assert found.attrs["accepted"] == 0
    assert np.isnan(found["bounds"]).all()
    assert float(found["volume"]) == 0
    assert found["volume_interval"].values[1] == pytest.approx(1 - 0.025**0.001)  # all of 1000 outside: (1 - p)^1000


def test_fewer_processors_inside_of_a_block():
    before = processors.available()
    with processors.at_most(1):
        assert processors.available() == 1
    assert processors.available() == before >= 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"samples": 0}, "samples must be a whole number from 1"),
        ({"samples": 2.5}, "got 2.5"),
        ({"method": "dice"}, "method must be one of random, sobol, grid, adaptive, got 'dice'"),
        ({"seed": -1}, "seed must be a whole number"),
        ({"workers": 0}, "workers must be"),
        ({"keep": "some"}, "keep must be one of accepted, all, none, got 'some'"),
        ({"resume": True}, "checkpoint must be a path if resume is True"),
        ({"size": 0.1}, "size must be left out unless method is adaptive, got 0.1"),
        ({"method": "adaptive", "size": -1.0}, "size must be a number from 1e-09 to 1e+09 [m], or None, got -1.0"),
        ({"method": "adaptive", "size": "fine"}, "size must be a number"),
        ({"method": "adaptive", "samples": 4}, "samples must be at least 8, the corners of a cell, got 4"),
        ({"region": {"position": {"min": [0, 0, 0], "max": [0, 0, 0]}}}, "region.position must have min below max"),
        ({"region": {"position": {"min": [1, 0, 0], "max": [0, 1, 1]}}}, "exceed max, 0 m along x, got 1 m"),
        ({"region": {"attitude": {"min": [0, 0, 0], "max": [0, 0, 1]}}}, "equal min and max of yaw"),
        ({"region": {"attitude": {"min": [0, 0, 1], "max": [0, 0, 0]}}}, "exceed max, 0 rad for yaw, got 1 rad"),
        ({"region": {"carriers": "reach"}}, "without mobile carriers"),
        (
            {"region": {"carriers": {"nobody": {"min": [0, 0, 0], "max": [1, 1, 1]}}}},
            "region.carriers must have the names frame, got 'nobody'",
        ),
        ({"region": {"lengths": {"min": 2, "max": 1}}}, "lengths.min must be at most max (1), got 2"),
        ({"region": {"lengths": {"min": 0.1, "max": 0.2}}}, "long enough for the three cables to meet"),
        ({"region": {"box": 1}}, "is not a known key"),
        ({"region": 5}, "region"),
        ({"samples": np.nan}, "samples must be a whole number"),
        ({"samples": True}, "samples must be a whole number"),
        ({"samples": 10**13}, "got 10000000000000"),
        ({"points_max": -1}, "points_max must be"),
        ({"method": None}, "method must be one of"),
        ({"keep": []}, "keep must be one of"),
        ({"scheduler": 8786}, "scheduler must be the address"),
        ({"checkpoint": 5}, "checkpoint must be a path"),
        ({"resume": "yes"}, "resume must be True or False"),
        ({"progress": 1}, "progress must be a function"),
        ({"method": "adaptive", "samples": 10**7}, "samples with method adaptive must be"),
        ({"method": "adaptive", "size": np.nan}, "size must be a number"),
    ],
)
def test_wrong_input_is_one_line(arguments, message):
    with pytest.raises(InputError) as caught:
        sample(hanging_mass(), REST, **arguments)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_robot_is_given_by_its_name_as_everywhere():
    by_name, loaded = (sample(robot, REST, samples=100, keep="none") for robot in ("wang-flying", load("wang-flying")))
    assert by_name.attrs["accepted"] == loaded.attrs["accepted"] > 0
    for wrong, message in ((7, "robot must be a Robot, .* got 7"), ("wang-flyin", "wang-flying")):
        with pytest.raises(InputError, match=message):
            sample(wrong, REST)


def test_many_cables_have_no_place_by_lengths():
    with pytest.raises(InputError, match="three cables and the coordinates x, y and z, got 8 cables and x, y, z, roll"):
        sample(load("ipanema-1"), REST, {"lengths": {"min": 1, "max": 2}})
