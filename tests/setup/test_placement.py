"""The stock a job asks for, and where the part lies in it.

A part is laid into a given stock so that the farthest point of the stock is as near as can be.

A turned blank: its mesh, laid as rays, is the body of revolution of its profile.
"""

import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from bonecam.errors import StockError
from bonecam.job import StockJob
from bonecam.job.stock_section import STOCK_KINDS
from bonecam.mesh import TriangleMesh, write_mesh
from bonecam.setup import Box, Capsule, ConvexStock, Cylinder, Schedule, smallest_capsule, stock_figures, stocks
from bonecam.setup.placement import centring_shift, may_centre, stock_for
from bonecam.setup.rounding import MARGIN
from bonecam.setup.stock import kind_of, stock_text

KINDS = ("capsule", "cylinder", "box")
SCHEDULE = Schedule((0.1,) * 4, 0.5)


def cloud() -> np.ndarray:
    points = np.random.default_rng(8).normal(size=(800, 3))
    return points / np.linalg.norm(points, axis=1)[:, None] * [4.0, 3.0, 12.0] + [0, 0, 3.0]


def lying(points: np.ndarray, transform: np.ndarray) -> np.ndarray:
    return points @ transform[:3, :3].T + transform[:3, 3]


@pytest.mark.parametrize("kind", KINDS)
def test_the_smallest_stock_leaves_the_allowance_over_the_part(kind):
    points, allowance = cloud(), 0.7
    stock, transform = stock_for(points, StockJob(kind=kind, allowance=allowance, spare_volume=0.0), SCHEDULE)
    inside = stock.signed_distance(lying(points, transform)).max()
    assert stock.kind == kind
    if kind != "cylinder":
        assert inside == pytest.approx(-allowance, abs=1e-6)
    else:  # the bar round the smallest capsule, to which it is rounded
        capsule = smallest_capsule(points, allowance)
        assert (stock.diameter, stock.length) == pytest.approx((capsule.diameter, capsule.length))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("spare", [0.0, 0.03])
def test_the_least_allowance_there_is_finds_a_stock(kind, spare):
    points = cloud()
    stock, transform = stock_for(points, StockJob(kind=kind, allowance=MARGIN, spare_volume=spare), SCHEDULE)
    assert stock.signed_distance(lying(points, transform)).max() <= -MARGIN + 1e-6


def test_a_little_larger_capsule_that_takes_fewer_cuts_is_taken():
    angle, height = np.meshgrid(2 * np.pi * np.arange(60) / 60, np.linspace(-15.0, 15.0, 80))
    reach = 6.0 - 0.2 * (height + 15.0)  # a cone: in the smallest capsule its thin end lies far from the cap's rim
    points = np.stack([reach * np.cos(angle), reach * np.sin(angle), height], axis=2).reshape(-1, 3)

    def cuts(capsule):
        return SCHEDULE.lower_bound(float(cKDTree(points).query(capsule.mesh(0.005).vertices)[0].max()))

    smallest, found = (stock_for(points, StockJob(spare_volume=spare), SCHEDULE)[0] for spare in (0.0, 0.03))
    assert isinstance(smallest, Capsule)
    assert isinstance(found, Capsule)
    assert smallest.volume == pytest.approx(smallest_capsule(points, StockJob().allowance).volume)
    assert smallest.volume < found.volume <= 1.03 * smallest.volume
    assert cuts(found) < cuts(smallest)
    assert found.signed_distance(points).max() == pytest.approx(-StockJob().allowance, abs=1e-6)


@pytest.mark.parametrize(
    "job",
    [
        StockJob(diameter=12.0, length=30.0),
        StockJob(diameter=12.0),
        StockJob(kind="cylinder", diameter=12.0, length=30.0),
        StockJob(kind="cylinder", diameter=12.0),
        StockJob(kind="cylinder", length=30.0),
        StockJob(kind="box", width=12.0, depth=11.0, length=30.0),
        StockJob(kind="box", width=12.0),
    ],
)
def test_given_sizes_are_kept_and_the_others_found(job):
    points = cloud()
    stock, transform = stock_for(points, job, SCHEDULE)
    low, high = stock.bounds
    if job.diameter:
        assert stock.diameter == pytest.approx(job.diameter)
    if job.length:
        assert stock.length == pytest.approx(job.length)
        assert low[2] + high[2] == pytest.approx(points[:, 2].min() + points[:, 2].max())
    if job.width:
        assert (high - low)[0] == pytest.approx(job.width)
    assert stock.signed_distance(lying(points, transform)).max() <= -min(MARGIN, job.allowance)


@pytest.mark.parametrize("kind", KINDS)
def test_the_part_is_shifted_in_the_stock_not_the_stock(kind):
    sizes = {"width": 14.0, "depth": 14.0} if kind == "box" else {"diameter": 14.0}
    plain = StockJob(kind=kind, length=34.0, **sizes)
    moved = StockJob(kind=kind, length=34.0, offset_x=1.0, offset_y=-0.5, offset_z=1.5, **sizes)
    (stock, before), (same, after) = stock_for(cloud(), plain, SCHEDULE), stock_for(cloud(), moved, SCHEDULE)
    assert np.allclose(stock.bounds, same.bounds)
    assert np.allclose(lying(cloud(), after) - lying(cloud(), before), [1.0, -0.5, 1.5])


def test_the_part_is_tilted_about_its_middle():
    points = cloud()
    _, transform = stock_for(
        points, StockJob(diameter=20.0, length=36.0, tilt_x_deg=30.0, tilt_y_deg=-10.0, turn_deg=45.0), SCHEDULE
    )
    middle = (points.min(0) + points.max(0)) / 2
    assert np.allclose(lying(middle[None], transform)[0], middle)
    x, y, z = np.radians([30.0, -10.0, 45.0])
    about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    about_z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    assert np.allclose(transform[:3, :3], about_z @ about_y @ about_x)


def test_a_box_without_sizes_is_the_smallest():
    """Found by turning a half of an ellipsoid, off the axis, in steps of a tenth of a degree."""
    points = cloud()
    points = points[points[:, 0] > 0] @ np.diag([1.0, 2.0, 1.0]) + [3.0, -2.0, 0.0]
    stock, transform = stock_for(points, StockJob(kind="box", allowance=0.5), SCHEDULE)
    assert isinstance(stock, Box)

    def area(degrees):
        turn = np.radians(degrees)
        lying = points[:, :2] @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        return float(np.prod(np.ptp(lying, axis=0) + 1.0))

    least = min(area(degrees) for degrees in np.arange(0.0, 90.0, 0.1))
    assert least > float(np.prod((stock.high - stock.low)[:2])) > 0.99 * least
    room = stock.high - stock.low - np.ptp(lying(points, transform), axis=0)
    assert room == pytest.approx([1.0, 1.0, 1.0])
    assert stock.middle[:2] == pytest.approx([0.0, 0.0])


def test_a_part_that_is_shifted_stays_so_in_a_box_that_is_found():
    points = cloud()
    placed, shifted = (stock_for(points, StockJob(kind="box", offset_x=x), SCHEDULE)[1] for x in (0.0, 1.0))
    middle = (points.min(0) + points.max(0)) / 2
    assert shifted[:3, :3] == pytest.approx(placed[:3, :3])
    assert lying(middle[None], shifted)[0] == pytest.approx(np.add(middle, [1.0, 0.0, 0.0]))


def test_a_stock_from_a_file_is_taken_as_it_is_or_as_its_smallest_copy(tmp_path):
    file = tmp_path / "block.stl"
    write_mesh(Cylinder(8.0, 100.0, 140.0, (30.0, 5.0)).mesh(0.5), file)
    stock, _ = stock_for(cloud(), StockJob(kind="mesh", mesh=str(file)), SCHEDULE)
    assert isinstance(stock, ConvexStock)
    assert np.allclose(stock.middle, [0, 0, 3], atol=0.05)
    assert (stock.diameter, stock.length) == pytest.approx((16.0, 40.0), abs=0.2)
    assert stock_text(stock_figures(stock)) == f"mesh 15.77 x 15.88 x 40.00 mm of {file}"
    smallest, transform = stock_for(cloud(), StockJob(kind="mesh", mesh=str(file), scale=0.0, allowance=0.4), SCHEDULE)
    assert smallest.signed_distance(lying(cloud(), transform)).max() == pytest.approx(-0.4, abs=1e-6)
    assert smallest.length < stock.length


def test_the_body_of_a_file_is_proven_once(tmp_path, monkeypatch):
    write_mesh(Cylinder(8.0, 0.0, 40.0).mesh(0.5), tmp_path / "block.ply")
    proofs: list[TriangleMesh] = []
    monkeypatch.setattr("bonecam.setup.stocks.mesh._require_convex", proofs.append)
    stock, _ = stock_for(cloud(), StockJob(kind="mesh", mesh=str(tmp_path / "block.ply"), scale=0.0), SCHEDULE)
    assert len(proofs) == 1
    ConvexStock(stock.mesh(10.0))
    assert len(proofs) == 2


def test_a_stock_file_that_is_no_convex_body_is_named(tmp_path):
    bar = Cylinder(8.0, 0.0, 40.0).mesh(0.5)
    waist = 1 - 0.3 * np.exp(-(((bar.vertices[:, 2:] - 20) / 6) ** 2))
    write_mesh(TriangleMesh(bar.vertices * np.hstack([waist, waist, 1 + 0 * waist]), bar.faces), tmp_path / "waist.stl")
    with pytest.raises(
        StockError, match=r"waist\.stl: the stock is not convex: it lies 2\.\d+ mm inside .* at \("
    ) as caught:
        stock_for(cloud(), StockJob(kind="mesh", mesh=str(tmp_path / "waist.stl")), SCHEDULE)
    assert caught.value.evidence["distance"] > 2


@pytest.mark.parametrize(("factor", "hint"), [(1e-3, ", or stock.scale = 1000 where its file is in metres"), (0.1, "")])
def test_a_stock_file_in_metres_is_told_as_that(factor, hint, tmp_path):
    bar = Cylinder(8.0, 0.0, 40.0).mesh(0.5)
    write_mesh(TriangleMesh(factor * bar.vertices, bar.faces), tmp_path / "bar.stl")
    larger = r"to each side, or a larger stock\.scale \(0 finds the smallest copy that holds it\)"
    with pytest.raises(StockError, match=f"{larger}{hint}$"):
        stock_for(cloud(), StockJob(kind="mesh", mesh=str(tmp_path / "bar.stl")), SCHEDULE)


@pytest.mark.parametrize(
    "sizes",
    [
        {"kind": "capsule", "diameter": 7.0, "length": 40.0},
        {"kind": "capsule", "diameter": 12.0, "length": 14.0},
        {"kind": "cylinder", "diameter": 7.0, "length": 40.0},
        {"kind": "cylinder", "diameter": 12.0, "length": 12.0},
        {"kind": "box", "width": 7.0, "depth": 20.0, "length": 40.0, "turn_deg": 5.0},
        {"kind": "box", "width": 7.0, "depth": 4.0, "length": 10.0},
    ],
)
def test_the_sizes_that_are_told_hold_the_part(sizes):
    with pytest.raises(StockError, match="give stock") as caught:
        stock_for(cloud(), StockJob(**sizes), SCHEDULE)
    told = re.findall(r"stock\.(\w+) at least ([\d.]+)", str(caught.value))
    larger = StockJob(**{**sizes, **{name: float(size) for name, size in told}})
    stock_for(cloud(), larger, SCHEDULE)


IMPOSSIBLE = {
    "leaves a capsule": (StockJob(diameter=7.0, length=30.0), "does not hold the part, which leaves it by"),
    "shifted out of a bar": (
        StockJob(kind="cylinder", diameter=10.0, length=30.0, offset_x=3.0),
        r"leaves it by .* at \(.*, or less of stock\.offset_x$",
    ),
    "tilted out of a box": (
        StockJob(kind="box", width=9.0, depth=9.0, length=26.0, tilt_x_deg=60.0),
        r"leaves it by .* at \(.*, or less of stock\.tilt_x_deg$",
    ),
    "touches the wall": (StockJob(kind="cylinder", diameter=8.01, length=30.0), "comes within 0.0.* mm of its wall"),
    "too narrow": (StockJob(diameter=7.0), "mm from the axis and .* mm above its lower end, .*: give at least"),
    "no diameter": (StockJob(length=30.0), "give the diameter"),
    "in the edges": (
        StockJob(kind="box", width=8.2, depth=6.2, length=24.2),
        r"too near to the edges of the stock \(box 8\.20 x 6\.20 x 24\.20 mm\) at \(",
    ),
    "no file": (StockJob(kind="mesh"), "needs a file"),
}


@pytest.mark.parametrize(("job", "trouble"), IMPOSSIBLE.values(), ids=IMPOSSIBLE)
def test_an_impossible_stock_is_refused_with_distance_and_place(job, trouble):
    points = cloud() if "edges" not in trouble else np.clip(3 * cloud(), [-4, -3, -9], [4, 3, 15])
    with pytest.raises(StockError, match=trouble) as caught:
        stock_for(points, job, SCHEDULE)
    if "leaves" in trouble:
        assert caught.value.evidence["distance"] > 0
        assert caught.value.evidence["place"].shape == (3,)


def test_a_place_is_told_where_the_stock_will_stand():
    job = StockJob(kind="cylinder", diameter=10.0, length=30.0, offset_x=3.0)
    with pytest.raises(StockError, match=r"the stock reaches from z = -12\.\d\d to 1[78]\.") as lying:
        stock_for(cloud(), job, SCHEDULE)
    with pytest.raises(StockError, match=r"the stock reaches from z = 40\.00 to 70\.00\)") as standing:
        stock_for(cloud(), job, SCHEDULE, bottom=40.0)
    lifted = standing.value.evidence["place"] - lying.value.evidence["place"]
    middle = (cloud()[:, 2].min() + cloud()[:, 2].max()) / 2
    assert lifted == pytest.approx([0.0, 0.0, 40.0 - (middle - 15.0)])


def test_every_file_of_stocks_is_a_kind_that_a_job_may_ask_for():
    files = {path.stem for path in Path(stocks.__file__).parent.glob("*.py")} - {"__init__"}
    assert set(STOCK_KINDS) == files
    for name in STOCK_KINDS:
        assert set(kind_of(StockJob(kind=name)).sizes) <= {item.name for item in fields(StockJob)}


STOCK = Capsule(np.array([0.0, 0.0, 7.5]), np.array([0.0, 0.0, 29.5]), 7.5)


def test_a_part_off_the_middle_is_brought_back_and_keeps_its_margin():
    rng = np.random.default_rng(4)
    points = rng.uniform([0, -3, 4], [4, 1, 33], (3000, 3))
    moved = centring_shift(points, STOCK, 0.05)
    assert np.allclose(moved[:3, :3] @ moved[:3, :3].T, np.eye(3))
    after, surface = points @ moved[:3, :3].T + moved[:3, 3], STOCK.mesh(0.1).vertices
    before, now = (cKDTree(p).query(surface)[0].max() for p in (points, after))
    assert now < before - 0.5
    assert STOCK.signed_distance(after).max() < -0.05
    assert (centring_shift(points, STOCK, 0.05) == moved).all()


def test_only_a_given_capsule_without_a_given_place_is_free():
    assert may_centre(StockJob(diameter=15.0, length=37.0))
    assert not may_centre(StockJob())
    assert not may_centre(StockJob(diameter=15.0, length=37.0, offset_x=0.5))
