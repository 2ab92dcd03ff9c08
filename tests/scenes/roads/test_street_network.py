"""Laws of the street network: large, irregular, curved, with the junctions a town has."""

import numpy as np
import pytest
import shapely

from echoscape.scenes.geometry.curves import headings, smallest_radius, turnaround
from echoscape.scenes.roads.street_network import Network
from echoscape.scenes.roads.subdivision import SubdivisionSettings, subdivided_network
from echoscape.scenes.town.presets import PRESETS


@pytest.fixture(scope="module", params=["town", "suburb", "industrial"])
def network(request: pytest.FixtureRequest) -> Network:
    subdivision = PRESETS[request.param].subdivision
    assert subdivision is not None
    return subdivided_network(subdivision, rng=np.random.default_rng(5))


def test_streets_enclose_a_square_kilometre(network: Network) -> None:
    hull = shapely.union_all([shapely.LineString(s.line) for s in network.streets]).convex_hull
    assert hull.area >= 1.0e6


def test_block_areas_vary(network: Network) -> None:
    lines = shapely.union_all([shapely.LineString(s.line) for s in network.streets], grid_size=0.01)
    areas = np.array(
        [block.area for block in shapely.get_parts(shapely.polygonize(shapely.get_parts(lines)))]
    )
    assert len(areas) > 15
    assert areas.std() / areas.mean() > 0.3


def test_streets_do_not_keep_to_two_directions(network: Network) -> None:
    heading = np.concatenate([headings(s.line) for s in network.streets])
    share, _ = np.histogram(heading % (np.pi / 2), bins=9, range=(0, np.pi / 2), density=False)
    assert share.max() / share.sum() < 0.4  # a grid has all in one or two of nine bins
    assert np.count_nonzero(share / share.sum() > 0.03) >= 6


def test_a_town_has_forks_crossings_and_a_roundabout(network: Network) -> None:
    arms = [len(network.arms(junction)) for junction in range(len(network.junctions))]
    assert arms.count(3) > 5
    assert arms.count(4) > 2
    assert len(network.roundabouts) >= 1


def test_streets_curve_gently_and_do_not_cross_outside_junctions(network: Network) -> None:
    assert min(smallest_radius(street.line) for street in network.streets) > 25.0
    lines = [shapely.LineString(street.line) for street in network.streets]
    tree = shapely.STRtree(lines)
    for first, second in tree.query(lines, predicate="crosses").T:
        if first < second:
            one, two = network.streets[first], network.streets[second]
            shared = {one.start, one.end} & {two.start, two.end}
            places = shapely.get_coordinates(lines[first].intersection(lines[second]))
            distance = [np.linalg.norm(places - network.junctions[j], axis=1).max() for j in shared]
            assert min(distance, default=np.inf) < 1.0


def test_equal_seeds_give_equal_streets() -> None:
    first, second = (
        subdivided_network(SubdivisionSettings(), rng=np.random.default_rng(3)) for _ in range(2)
    )
    np.testing.assert_array_equal(first.junctions, second.junctions)


@pytest.mark.parametrize(("aside_m", "radius_m"), [(1.6, 7.0), (1.4, 4.8), (4.8, 30.0)])
def test_a_turnaround_turns_by_pi_at_its_radius(aside_m: float, radius_m: float) -> None:
    line = turnaround(aside_m, radius_m, side_radius_m=2 * radius_m)
    heading = headings(line)
    assert heading[-1] - heading[0] == pytest.approx(np.pi, abs=5e-3)  # chords of 0.25 m
    assert smallest_radius(line) == pytest.approx(radius_m, rel=0.01)
    np.testing.assert_allclose(line[[0, -1]], [[0, -aside_m], [0, aside_m]], atol=1e-12)
