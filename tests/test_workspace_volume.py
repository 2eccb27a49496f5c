"""Volumes against exact ones, meshes against solids, pictures for what is on them."""

import numpy as np
import pytest

from towline.base.errors import InputError
from towline.figures import workspace as figures
from towline.models import Robot, load
from towline.workspace import Places, StaticEquilibrium, WrenchClosure
from towline.workspace.boundary_mesh import boundary, boundary_of_values
from towline.workspace.volume import volume

TRIANGLE = 3 * np.sqrt(3.0)  # [m^2], under the anchors of point-mass-3, 2 m from their middle


def without_limits(name):
    robot = load(name)
    data = robot.model_dump(mode="json")
    data["cables"] = [cable | {"t_min": 0.0, "t_max": 1e8} for cable in data["cables"]]
    return Robot.model_validate(data)


def uniform(robot, low, high, count, seed):
    poses = np.tile(robot.home, (count, 1))
    poses[:, :3] = np.random.default_rng(seed).uniform(low, high, (count, 3))
    return Places.at_home(robot, poses)


def test_a_point_mass_on_three_cables_has_the_prism_below_its_anchors():
    robot = without_limits("point-mass-3")
    low, high = np.array([-2.0, -1.5, 0.5]), np.array([2.0, 2.5, 3.2])
    held = StaticEquilibrium().holds(robot, uniform(robot, low, high, 40_000, seed=1))
    found = volume(int(held.sum()), held.size, float(np.prod(high - low)))
    assert found.low < TRIANGLE * 2.5 < found.high
    assert found.high - found.low < 0.05 * found.value


def test_with_its_limits_the_prism_is_what_the_tensions_leave():
    """The limits cut the prism: t = U^-1 w, by Cramer's rule on a fine grid, is the second derivation."""
    robot = load("point-mass-3")
    low, high = np.array([-2.0, -1.5, 0.0]), np.array([2.0, 2.5, 3.0])
    axes = [np.linspace(a, b, 101)[:-1] + (b - a) / 200 for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    ways = robot.home_anchors[None] - points[:, None]  # (n, 3, 3)
    a, b, c = np.moveaxis(ways, 1, 0)
    whole = np.einsum("ni,ni->n", a, np.cross(b, c))
    per_length = [np.cross(y, z)[:, 2] * robot.weight / whole for y, z in ((b, c), (c, a), (a, b))]
    tensions = np.stack(per_length, axis=1) * np.linalg.norm(ways, axis=2)
    exact = ((tensions >= 1) & (tensions <= 200)).all(axis=1).mean() * np.prod(high - low)
    held = StaticEquilibrium().holds(robot, uniform(robot, low, high, 40_000, seed=2))
    found = volume(int(held.sum()), held.size, float(np.prod(high - low)))
    assert found.low < exact < found.high
    assert exact < 0.98 * TRIANGLE * 3


def test_the_wrench_closure_area_of_a_planar_robot():
    """The null vector of a 3 x 4 matrix by determinants, on a fine grid, against samples."""
    robot = load("planar-4")
    low, high = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 1.5])
    x, z = (
        grid.ravel() for grid in np.meshgrid(np.linspace(-1, 1, 801)[:-1] + 1 / 800, np.arange(600) / 400 + 1 / 800)
    )
    arms = robot.attachments[:, [0, 2]]
    ways = robot.home_anchors[:, [0, 2]][None] - np.stack([x, z], axis=1)[:, None] - arms
    columns = np.concatenate([ways, (arms[:, 1] * ways[..., 0] - arms[:, 0] * ways[..., 1])[..., None]], axis=2)
    null = [
        (-1) ** i * np.einsum("ni,ni->n", columns[:, j], np.cross(columns[:, k], columns[:, h]))
        for i, (j, k, h) in enumerate(((1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)))
    ]
    exact = 3.0 * (np.all(np.array(null) > 0, axis=0) | np.all(np.array(null) < 0, axis=0)).mean()
    held = WrenchClosure().holds(robot, uniform(robot, low, high, 60_000, seed=3))
    found = volume(int(held.sum()), held.size, 3.0)
    assert found.low < exact < found.high
    assert 0.1 < exact < 2.9


def test_the_interval_covers_as_often_as_it_says():
    rng = np.random.default_rng(5)
    for share in (0.003, 0.4, 0.98):
        found = [volume(int(k), 500, 2.0) for k in rng.binomial(500, share, 400)]
        assert np.mean([one.low <= 2.0 * share <= one.high for one in found]) > 0.93


def test_nothing_and_everything_still_have_an_interval():
    nothing, everything = volume(0, 100, 1.0), volume(100, 100, 1.0)
    assert nothing.low == 0
    # By hand: all of n samples outside has probability (1 - p)^n.
    assert nothing.high == pytest.approx(1 - 0.025**0.01)
    assert everything.low == pytest.approx(0.025**0.01)
    assert everything.high == 1


@pytest.mark.parametrize(
    "wrong", [(1, 0, 1.0), (3, 2, 1.0), (1, 2, 0.0), (1, 2, 1.0, 1.0), (1, 2, np.nan), (1.5, 2, 1.0)]
)
def test_numbers_that_do_not_fit(wrong):
    with pytest.raises(InputError, match="must be a"):
        volume(*wrong)


def ball(radius, count=61):
    axis = np.linspace(-1, 1, count)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    return radius - np.sqrt(x**2 + y**2 + z**2)


def edges_of(mesh):
    return np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])


def test_the_mesh_of_a_ball():
    mesh = boundary_of_values(ball(0.7), np.full(3, -1.0), np.full(3, 1.0))
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.7**3, rel=2e-3)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 0.7, atol=1e-3)
    # Closed and turned one way: each edge is run through once in either direction.
    there = {tuple(edge) for edge in edges_of(mesh)}
    assert len(there) == 3 * len(mesh.faces)
    assert {(b, a) for a, b in there} == there


def test_the_mesh_ends_at_the_box():
    mesh = boundary_of_values(np.ones((5, 6, 7)), np.zeros(3), np.array([1.0, 2.0, 3.0]))
    assert mesh.volume == pytest.approx(6.0)
    assert boundary_of_values(-np.ones((3, 3, 3)), np.zeros(3), np.ones(3)).faces.size == 0


def test_the_mesh_of_the_prism_is_as_large_as_the_prism(tmp_path):
    robot = without_limits("point-mass-3")
    mesh = boundary(robot, StaticEquilibrium(), np.array([-2.0, -1.5, 0.5]), np.array([2.0, 2.5, 3.5]), cells=50)
    assert mesh.volume == pytest.approx(TRIANGLE * 2.5, rel=0.03)
    path = mesh.save(tmp_path / "prism.stl")
    data = path.read_bytes()
    count = int(np.frombuffer(data, "<u4", 1, 80)[0])
    assert count == len(mesh.faces)
    assert len(data) == 84 + 50 * count
    records = np.frombuffer(data, np.dtype([("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")]), count, 84)
    a, b, c = np.moveaxis(records["c"].astype(float), 1, 0)
    assert np.einsum("ni,ni->", a, np.cross(b, c)) / 6 == pytest.approx(mesh.volume, rel=1e-4)
    outward = np.einsum("ni,ni->n", records["n"], (a + b + c) / 3 - np.array([0, 0, 1.75]))
    assert np.quantile(outward, 0.01) > -0.2


def test_a_flat_box_has_no_mesh():
    robot = load("point-mass-3")
    with pytest.raises(InputError, match="low must be below high"):
        boundary(robot, StaticEquilibrium(), np.zeros(3), np.array([1.0, 0.0, 1.0]))


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"cells": np.nan}, "cells must be a whole number from 2"),
        ({"cells": 10**6}, "got 1000000"),
        ({"high": [1, 1, np.inf]}, r"high must be an array of shape \(3,\) of finite numbers"),
        ({"low": "here"}, "low must be an array of real numbers, got 'here'"),
        ({"attitude": [0, 0]}, r"attitude must be an array of shape \(3,\) of finite numbers"),
    ],
)
def test_a_mesh_of_nothing_sensible_is_refused(wrong, told):
    with pytest.raises(InputError, match=told):
        boundary(load("point-mass-3"), StaticEquilibrium(), **{"low": [0, 0, 0], "high": [1, 1, 1], **wrong})


def test_pictures_have_units_and_equal_scales():
    points = np.random.default_rng(0).uniform(0, 1, (500, 3))
    canvas = figures.projections({"one": points, "two": points + 0.2}, marks=np.eye(3))
    labels = [(ax.get_xlabel(), ax.get_ylabel()) for ax in canvas.axes]
    assert labels == [("", "y [m]"), ("x [m]", "z [m]"), ("y [m]", "")]  # of axes that are shared, the outer ones
    assert all(ax.get_aspect() == 1.0 for ax in canvas.axes)
    sections = figures.cross_sections(points, [0.2, 0.7], 0.1)
    near = (np.abs(points[:, 2] - 0.2) <= 0.05).sum()
    assert f"{near} points" in sections.axes[0].get_title(loc="left").replace("\n", " ")
