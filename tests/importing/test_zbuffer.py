"""Meshes seen from above: the highest surface, no holes, and what is lost in numbers."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import Delaunay

from terratool.errors import ReadError, RequestError
from terratool.importing.sampling import sample, steps
from terratool.importing.types import Triangles
from terratool.kernels import importing as kernels
from tests.budget import examples

UTM = (500_000.0, 6_000_000.0)


def mesh_of(vertices: Any, faces: Any) -> Triangles:
    return Triangles(np.array(vertices, np.float64), np.array(faces, np.int32).reshape(-1, 3))


def joined(*meshes: Triangles) -> Triangles:
    faces, first = [], 0
    for mesh in meshes:
        faces.append(mesh.faces + np.int32(first))
        first += len(mesh.vertices)
    return Triangles(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces))


def sheet(west: float, south: float, east: float, north: float, z: float) -> Triangles:
    """Two level triangles that face up."""
    corners = [(west, south, z), (east, south, z), (east, north, z), (west, north, z)]
    return mesh_of(corners, [(0, 1, 2), (0, 2, 3)])


def block(west: float, south: float, east: float, north: float, low: float, high: float):
    """A closed box whose faces face outward."""
    points = [(x, y, z) for z in (low, high) for y in (south, north) for x in (west, east)]
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6)]
    return mesh_of(points, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def flipped(mesh: Triangles) -> Triangles:
    return Triangles(mesh.vertices, mesh.faces[:, ::-1].copy())


def moved(mesh: Triangles, x: float, y: float) -> Triangles:
    return Triangles(np.add(mesh.vertices, (x, y, 0.0)), mesh.faces, mesh.notes)


GROUND = sheet(0, 0, 8, 4, 0)
THREAD = sheet(0, 0, 1e9, 1, 0)
THREE = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]


def rays(mesh: Triangles, xs: list[Fraction], ys: list[Fraction]) -> list[list[Fraction | None]]:
    """The highest surface at each x and y in exact arithmetic, edges included."""
    out: list[list[Fraction | None]] = [[None] * len(xs) for _ in ys]
    for face in mesh.faces.tolist():
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (
            [Fraction(n) for n in mesh.vertices[i].tolist()] for i in face
        )
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0:
            continue
        for row, y in enumerate(ys):
            for column, x in enumerate(xs):
                b = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
                c = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
                if b >= 0 and c >= 0 and b + c <= 1:
                    z, known = az + b * (bz - az) + c * (cz - az), out[row][column]
                    out[row][column] = z if known is None else max(known, z)
    return out


quarters = st.integers(-8, 28).map(lambda n: n / 4)
points = st.tuples(quarters, quarters, st.integers(-9, 9).map(float))
soups = st.lists(points, min_size=3, max_size=9).flatmap(
    lambda vertices: st.tuples(
        st.just(vertices),
        st.lists(
            st.tuples(*[st.integers(0, len(vertices) - 1)] * 3), min_size=1, max_size=8
        ),
    )
)  # fmt: skip


@settings(max_examples=examples(300))
@given(soups)
def test_heights_are_those_of_rays_from_above(soup: Any) -> None:
    """Any triangles at all, many of whose edges and corners lie on pixel centres."""
    mesh = mesh_of(*soup)
    heights, counts = np.full((5, 7), np.nan), np.zeros((5, 7), np.uint8)
    pixels = kernels.to_pixels(mesh.vertices, -0.5, -0.5, 1.0, 1.0)
    kernels.paint_faces(pixels, mesh.faces, 1e-9, heights, counts)
    true = rays(mesh, [Fraction(n) for n in range(7)], [Fraction(n) for n in range(5)])
    wanted = np.array([[np.nan if z is None else float(z) for z in row] for row in true])
    np.testing.assert_allclose(heights, wanted, rtol=0, atol=1e-12)


@settings(max_examples=examples(100))
@given(soups, st.sampled_from([0.25, 0.5, 1.0]))
def test_large_coordinates_change_nothing(soup: Any, resolution: float) -> None:
    mesh = mesh_of(*soup)
    bounds = (-0.5, -0.25, 6.5, 4.75)
    try:
        near = sample(mesh, resolution, bounds)
    except (ReadError, RequestError) as error:
        with pytest.raises(type(error)):
            sample(moved(mesh, *UTM), resolution, _shifted(bounds))
        return
    far = sample(moved(mesh, *UTM), resolution, _shifted(bounds))
    np.testing.assert_array_equal(far.values, near.values)
    assert far.notes == near.notes
    assert far.grid.bounds == _shifted(near.grid.bounds)


def _shifted(bounds: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    west, south, east, north = bounds
    return west + UTM[0], south + UTM[1], east + UTM[0], north + UTM[1]


def test_rows_count_from_the_south_and_columns_from_the_west() -> None:
    """One triangle in the south-east of an oblong patch, which rises to the north."""
    mesh = mesh_of([(6, 0, 0), (8, 0, 0), (8, 2, 4)], [(0, 1, 2)])
    samples = sample(mesh, 1.0, (0.0, 0.0, 8.0, 3.0))
    assert samples.values.shape == (3, 8) == (samples.grid.rows, samples.grid.columns)
    wanted = np.full((3, 8), np.nan)
    wanted[0, 6:] = 1.0  # the first is on the slanting edge
    wanted[1, 7] = 3.0
    np.testing.assert_array_equal(samples.values, wanted)


def scattered(seed: int, count: int, width: float, depth: float) -> tuple[Triangles, Delaunay]:
    """An irregular triangulation of an oblong whose sides are straight; heights of a rough hill."""
    rng = np.random.default_rng(seed)
    rim = [(x * width / 9, y * depth) for x in range(10) for y in (0, 1)]
    rim += [(x * width, y * depth / 5) for x in (0, 1) for y in range(1, 5)]
    plan = np.concatenate([rim, rng.uniform(0.001, 0.999, (count, 2)) * (width, depth)])
    x, y = plan.T
    z = np.sin(3 * x / width) * 5 + y * y / depth + rng.uniform(0, 0.5, len(plan))
    web = Delaunay(plan)
    faces = web.simplices.astype(np.int32)
    faces[::3] = faces[::3, ::-1]  # normals this way and that
    return Triangles(np.column_stack([plan, z]), faces), web


@pytest.mark.slow
@pytest.mark.parametrize("offset", [(0.0, 0.0), UTM])
def test_heights_are_those_of_the_planes_of_triangles(offset: tuple[float, float]) -> None:
    """SciPy's linear interpolation on the same triangles says the same."""
    mesh, web = scattered(1, 3000, 90.0, 40.0)
    samples = sample(moved(mesh, *offset), 0.5)
    assert samples.values.shape == (80, 180)
    x = 0.25 + 0.5 * np.arange(180)
    y = 0.25 + 0.5 * np.arange(80)
    wanted = LinearNDInterpolator(web, mesh.vertices[:, 2])(*np.meshgrid(x, y))
    # steep slivers magnify what a double of 6e6 loses, 1e-9
    np.testing.assert_allclose(samples.values, wanted, rtol=0, atol=1e-5 if offset[0] else 1e-9)
    assert not samples.notes


@settings(max_examples=examples(30))
@given(st.integers(0, 10_000), st.sampled_from([0.0, 1e-7, 1 / 3, 6e6 + 1 / 3]))
def test_no_centre_between_triangles_is_missed(seed: int, offset: float) -> None:
    """Nor is one counted twice: a sheet covers each centre once."""
    mesh, _ = scattered(seed, 400, 7.0, 3.0)
    heights, counts = np.full((120, 280), np.nan), np.zeros((120, 280), np.uint8)
    # the outermost centres lie well within
    vertices = moved(mesh, offset, offset).vertices
    pixels = kernels.to_pixels(vertices, offset, offset, 0.025, 0.025)
    kernels.paint_faces(pixels, mesh.faces, 0.0, heights, counts)
    assert not np.isnan(heights).any()
    assert (counts == 1).all()


@pytest.mark.parametrize("turn", range(4))
def test_centres_on_the_rim_belong_to_the_mesh(turn: int) -> None:
    """Bounds that put centres on all four sides and through all corners of a lattice of faces."""
    n = np.arange(4 * 6).reshape(4, 6)
    y, x = np.divmod(n.ravel(), 6)
    a, b, c, d = n[:-1, :-1].ravel(), n[:-1, 1:].ravel(), n[1:, 1:].ravel(), n[1:, :-1].ravel()
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    mesh = mesh_of(np.column_stack([x, y, 2 * x - 3 * y]), np.roll(faces, turn, axis=1))
    samples = sample(mesh, 0.5, (-0.25, -0.25, 5.25, 3.25))
    x, y = 0.5 * np.arange(11), 0.5 * np.arange(7)
    np.testing.assert_array_equal(samples.values, 2 * x - 3 * y[:, None])
    assert not samples.notes


@pytest.mark.parametrize("seed", range(4))
def test_corners_on_centres_keep_their_heights_and_count_once(seed: int) -> None:
    """A sheet cut along either diagonal, wound either way, each face from any corner on."""
    rng = np.random.default_rng(seed)
    n = np.arange(5 * 8).reshape(5, 8)
    y, x = np.divmod(n.ravel(), 8)
    z = 10.0 ** rng.uniform(-6, 6, n.size)
    faces = []
    for a, b, c, d in zip(
        n[:-1, :-1].flat, n[:-1, 1:].flat, n[1:, 1:].flat, n[1:, :-1].flat, strict=True
    ):
        pair = [(a, b, c), (a, c, d)] if rng.random() < 0.5 else [(a, b, d), (b, c, d)]
        faces += [np.roll(face, rng.integers(3))[:: rng.choice([-1, 1])] for face in pair]
    points = np.column_stack([x, y, z]).astype(np.float64)
    heights, counts = np.full((5, 8), np.nan), np.zeros((5, 8), np.uint8)
    kernels.paint_faces(points, np.array(faces, np.int32), 1e-9, heights, counts)
    np.testing.assert_array_equal(heights, z.reshape(5, 8))
    wanted = np.ones((5, 8))
    wanted[-1] = wanted[:, -1] = 0  # a face does not count on its own north and east sides
    np.testing.assert_array_equal(counts, wanted)


@pytest.mark.parametrize(("beyond", "belongs"), [(5e-10, True), (5e-9, False)])
def test_how_near_to_the_rim_a_centre_belongs(beyond: float, belongs: bool) -> None:
    """The outermost centres lie a little to the west of the mesh, or to the south of it."""
    west, south = -0.5 - beyond, -0.5
    values = sample(GROUND, 1.0, (west, south, west + 8, south + 4)).values
    assert (np.isnan(values[:, 0]) == (not belongs)).all()
    values = sample(GROUND, 1.0, (south, west, south + 8, west + 4)).values
    assert (np.isnan(values[0]) == (not belongs)).all()
    assert not np.isnan(values[1:]).any()


def test_coordinates_that_doubles_hardly_hold_do_not_spread() -> None:
    """At 1e15 doubles are an eighth apart; pixels beside the mesh still have no height."""
    mesh = moved(sheet(0, 0, 8, 4, 2.0), 1e15, 1e15)
    values = sample(mesh, 0.25, (1e15 - 4, 1e15 - 4, 1e15 + 12, 1e15 + 8)).values
    assert (~np.isnan(values)).sum() <= 33 * 17


@pytest.mark.parametrize("third", [0.1, 0.3, 0.7, 1 / 3, 1.1])
@pytest.mark.parametrize("offset", [0.0, 7e5])
def test_centres_on_a_slanting_rim_belong_to_the_mesh(third: float, offset: float) -> None:
    """Every third centre is meant to lie on the side that rises by one pixel on three."""
    side = 300 * third
    mesh = moved(
        mesh_of([(0, 0, 1), (side, 0, 1), (side, side / 3, 1)], [(0, 1, 2)]), offset, offset
    )
    west = offset - third / 2
    bounds = (west, west, west + 301 * third, west + 101 * third)
    values = sample(mesh, third, bounds).values
    assert values.shape == (101, 301)
    column, row = np.meshgrid(np.arange(301), np.arange(101))
    np.testing.assert_array_equal(values == 1, 3 * row <= column)


@pytest.mark.parametrize("tenth", [0.1, 1 / 3, 0.7])
def test_a_rim_that_doubles_cannot_hold_belongs_to_the_mesh(tenth: float) -> None:
    """Centres are meant to lie on the rim, but are rounded to either side of it."""
    mesh = moved(sheet(0, 0, 7 * tenth, 3 * tenth, 2.5), 5e5 + tenth, 6e6 + tenth)
    west, south = 5e5 + tenth / 2, 6e6 + tenth / 2
    samples = sample(mesh, tenth, (west, south, west + 8 * tenth, south + 4 * tenth))
    np.testing.assert_array_equal(samples.values, np.full((4, 8), 2.5))


def test_the_bounds_need_not_be_whole_pixels() -> None:
    samples = sample(sheet(0, 0, 2.3, 1.6, 1.0), 1.0)
    assert samples.grid.bounds == (0, 0, 3, 2)
    np.testing.assert_array_equal(samples.values, [[1, 1, np.nan], [1, 1, np.nan]])
    assert samples.notes == (
        "2 of 6 pixels (33 %, 2 m²) lie beyond the outline of the mesh and have no height.",
    )


@pytest.mark.parametrize(
    ("size", "pixels"),
    [
        ((100.0, 25.0), (512, 128)),
        ((30.0, 60.0), (256, 512)),
        ((9.0, 7.0), (504, 392)),
        ((1000.0, 0.5), (2000, 1)),
    ],
)
def test_a_resolution_is_chosen(size: tuple[float, float], pixels: tuple[int, int]) -> None:
    samples = sample(sheet(3, -4, 3 + size[0], -4 + size[1], 7.0))
    assert (samples.grid.columns, samples.grid.rows) == pixels
    assert (samples.values == 7).all()
    assert samples.notes[0].startswith("No resolution was given: a pixel is")


DECK = sheet(1, 1, 6, 3, 2)  # 5 × 2 pixels
CAVE = joined(block(0, 0, 8, 4, -1, 0), block(1, 1, 6, 3, 2, 3))


@pytest.mark.parametrize(
    ("mesh", "pixels"),
    [
        pytest.param(GROUND, 0, id="a sheet"),
        pytest.param(flipped(GROUND), 0, id="a sheet that faces down"),
        pytest.param(joined(GROUND, flipped(GROUND)), 0, id="a sheet with two sides"),
        pytest.param(joined(GROUND, GROUND), 0, id="a sheet that is there twice"),
        pytest.param(block(0, 0, 8, 4, -1, 0), 0, id="a solid"),
        pytest.param(flipped(block(0, 0, 8, 4, -1, 0)), 0, id="a solid inside out"),
        pytest.param(joined(GROUND, DECK), 10, id="a bridge"),
        pytest.param(joined(GROUND, flipped(DECK)), 10, id="a bridge that faces down"),
        pytest.param(joined(flipped(GROUND), flipped(DECK)), 10, id="a bridge, all facing down"),
        pytest.param(joined(GROUND, DECK, flipped(DECK)), 10, id="a bridge with two sides"),
        pytest.param(joined(GROUND, block(1, 1, 6, 3, 1, 2)), 10, id="a thick bridge"),
        pytest.param(CAVE, 10, id="a solid over a solid"),
        pytest.param(flipped(CAVE), 10, id="the same inside out"),
        pytest.param(joined(GROUND, block(1, 1, 6, 3, 0, 2)), 0, id="a block on the ground"),
        pytest.param(joined(GROUND, block(1, 1, 6, 3, -1, 2)), 0, id="a block sunk in the ground"),
        pytest.param(
            joined(block(0, 0, 8, 4, -1, 0), block(1, 1, 6, 3, -0.5, 2)), 0, id="sunk in a solid"
        ),
        pytest.param(
            joined(GROUND, *(sheet(1, 1, 6, 3, z) for z in range(1, 257))), 10, id="257 floors"
        ),
        pytest.param(
            joined(sheet(0, 3, 8, 4, 0), flipped(sheet(0, 0, 8, 3, 0)), sheet(0, 3, 8, 4, 0),
                   sheet(6, 0, 8, 3, 1), sheet(0, 0, 6, 1, 1), sheet(0, 1, 1, 3, 1), flipped(DECK)),
            10, id="two sheets upside down in one that is not",
        ),
        pytest.param(
            joined(sheet(0, 0, 8, 4, 2), flipped(GROUND), flipped(sheet(1, 1, 6, 3, -9))), 10,
            id="two undersides",
        ),
    ],
)  # fmt: skip
@pytest.mark.parametrize("lift", [0.0, -50.0, 50.0])
def test_overhangs_are_counted(mesh: Triangles, pixels: int, lift: float) -> None:
    samples = sample(Triangles(np.add(mesh.vertices, (0, 0, lift)), mesh.faces), 1.0)
    assert samples.values.shape == (4, 8)
    top = mesh.vertices[:, 2].max() + lift
    assert (samples.values[1:3, 1:6] == top).all()
    notes = [note for note in samples.notes if "overhang" in note]
    if not pixels:
        assert notes == []
    else:
        assert notes == [
            "In 10 of 32 pixels (31 %, 10 m²) a surface lies below the highest one, under an "
            "overhang; only the highest is kept."
        ]


def test_one_surface_that_is_cut_in_two_ways_is_no_overhang() -> None:
    """Its heights differ by what doubles round."""
    corners = [(x, y, 0.1 * x + y / 3) for x, y in ((0, 0), (7, 0), (7, 5), (0, 5))]
    mesh = mesh_of(corners, [(0, 1, 2), (0, 2, 3), (0, 1, 3), (1, 2, 3)])
    assert sample(mesh, 0.1).notes == ()


def test_a_sheet_that_folds_over_itself_overhangs() -> None:
    """A wave that breaks to the east: from x = 3 to 5 there are three surfaces."""
    profile = [(0, 0), (5, 3), (3, 1), (8, 0)]
    vertices = [(x, y, z) for x, z in profile for y in (0, 3)]
    faces = [t for n in (0, 2, 4) for t in ((n, n + 2, n + 1), (n + 1, n + 2, n + 3))]
    samples = sample(mesh_of(vertices, faces), 1.0)
    assert [note for note in samples.notes if "overhang" in note] == [
        "In 6 of 24 pixels (25 %, 6 m²) a surface lies below the highest one, under an overhang; "
        "only the highest is kept."
    ]


def cells(rows: list[str]) -> Triangles:
    """Unit squares where a picture, north up, has a #."""
    squares = [
        sheet(x, y, x + 1, y + 1, x + 10 * y)
        for y, row in enumerate(reversed(rows))
        for x, sign in enumerate(row)
        if sign == "#"
    ]
    return joined(*squares)


def test_holes_are_told_from_what_lies_beyond() -> None:
    mesh = cells(["#######..", "#.##..#..", "#.#####..", "######.##", "...######"])
    notes = sample(mesh, 1.0).notes
    assert notes[0].startswith("The mesh has holes: 5 of 45 pixels (11 %, 5 m²) within")
    assert notes[1].startswith("9 of 45 pixels (20 %, 9 m²) lie beyond the outline")
    assert len(notes) == 2


def test_bays_are_no_holes_whichever_way_they_open() -> None:
    mesh = cells(
        ["###.####", "#.#.#...", "###.####", "####....", "....####", "##.#####", "##.#####"]
    )
    notes = sample(mesh, 1.0).notes
    assert notes[0].startswith("The mesh has holes: 1 of 56 pixels")
    assert notes[1].startswith("16 of 56 pixels")


def test_vertical_faces_are_measured_but_for_the_sides_of_a_solid() -> None:
    mesh = joined(block(0, 0, 8, 4, -1, 0), block(2, 1, 6, 3, 0, 0.5))
    assert sample(mesh, 1.0).notes == (
        "6 m² of vertical faces are not seen from above; each becomes a step within one pixel.",
    )


def test_what_has_no_area_and_what_lies_outside_is_counted() -> None:
    mesh = joined(sheet(0, 0, 8, 4, 1), mesh_of([(1, 1, 9), (2, 2, 9), (3, 3, 9)], [(0, 1, 2)] * 3))
    assert sample(mesh, 1.0).notes == ("3 of 5 faces have no area and count for nothing.",)
    mesh = joined(cells(["##", "##"]), sheet(5, 0, 6, 1, 3.0))
    samples = sample(mesh, 0.5, (0.0, 0.0, 1.5, 1.0))
    assert samples.values.shape == (2, 3)
    assert samples.notes == ("2 of 10 faces lie outside of the bounds.",)
    assert np.nanmax(samples.values) < 3


def test_a_wall_that_stands_free_is_not_seen() -> None:
    wall = mesh_of([(0.5, 0, 0), (0.5, 4, 0), (0.5, 4, 9), (0.5, 0, 9)], [(0, 1, 2), (0, 2, 3)])
    samples = sample(joined(GROUND, wall), 1.0)  # it stands on the centres of the first column
    assert (samples.values == 0).all()
    assert samples.notes[0].startswith("36 m² of vertical faces")


@pytest.mark.parametrize(
    ("mesh", "resolution", "bounds", "error", "words"),
    [
        (mesh_of([(0, 0, 0)], []), 1.0, None, ReadError, "no faces"),
        (mesh_of([(0, 0, 0), (1, 1, 1), (2, 2, 2)], [(0, 1, 2)]), 1.0, None, ReadError, "area"),
        (mesh_of([(0, 0, 0), (1, 1, 0), (1, 1, 3)], [(0, 1, 2)]), 1.0, None, ReadError, "vertical"),
        (mesh_of([(0, 0, 0), (1, 0, 0), (1, 0, 3)], [(0, 1, 2)]), None, None, ReadError, "vert"),
        (mesh_of(THREE, [(0, 1, 3)]), 1.0, None, ReadError, "not there"),
        (mesh_of(THREE, [(0, 1, -1)]), 1.0, None, ReadError, "not there"),
        (mesh_of([*THREE, (np.nan, 0, 0)], [(0, 1, 2)]), 1.0, None, ReadError, "no numbers"),
        (THREAD, None, None, RequestError, "no pixel has its centre"),
        (GROUND, 0.0, None, RequestError, "resolution is 0"),
        (GROUND, -1.0, None, RequestError, "resolution is -1"),
        (GROUND, np.nan, None, RequestError, "resolution is nan"),
        (GROUND, np.inf, None, RequestError, "resolution is inf"),
        (GROUND, 1e-4, None, RequestError, "pixels, more than"),
        (GROUND, 1e-300, None, RequestError, "pixels, more than"),
        (GROUND, 100.0, None, RequestError, r"no pixel has its centre .*The mesh lies in "),
        (GROUND, 1.0, (0, 0, 0, 4), RequestError, "are empty"),
        (GROUND, 1.0, (0, 0, np.nan, 4), RequestError, "bounds are 0 0 nan 4"),
        (GROUND, 1.0, (8, 0, 9, 4), RequestError, r"miss .*, where .* lies\."),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused(
    mesh: Triangles, resolution: Any, bounds: Any, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words) as caught:
        sample(mesh, resolution, bounds)
    assert caught.value.message.endswith(".")  # type: ignore[attr-defined]
    assert caught.value.hint.endswith(".")  # type: ignore[attr-defined]


def test_reading_by_rows_is_the_same() -> None:
    samples = sample(cells(["###", "###", "###", "###"]), 0.5)
    np.testing.assert_array_equal(samples.read(2, 3), samples.values[2:5])


def upright(axis: int, at: float, begin: float, end: float, low: float, high: float) -> Triangles:
    """A vertical rectangle."""
    corners: list[NDArray[np.float64]] = []
    for along, z in ((begin, low), (end, low), (end, high), (begin, high)):
        point = np.array([0.0, 0.0, z])
        point[axis], point[1 - axis] = at, along
        corners.append(point)
    return mesh_of(corners, [(0, 1, 2), (0, 2, 3)])


@pytest.mark.parametrize("axis", [0, 1])
def test_walls_across_the_whole_patch_are_steps(axis: int) -> None:
    (x, y), long, other = UTM, 10.0, 6.0
    walls = [
        upright(axis, 7, 0, other, 0, 1), upright(axis, 7, 1, 2, 1, 3),  # in one piece, with a post
        upright(axis, 7, -5, -3, 0, 1),  # that goes on elsewhere
        upright(axis, 2.5, -1, 3, 0, 1), upright(axis, 2.5, 3, other + 1, 4, 5),  # in two
        upright(axis, 4, 0, 3, 0, 1), upright(axis, 4, 3.1, other, 0, 1),  # with a gap
        upright(axis, 5, 0.5, other, 0, 1),  # too short
        upright(axis, 0, 0, other, 0, 1), upright(axis, long, 0, other, 0, 1),  # on the rim
        upright(axis, 12, 0, other, 0, 1),  # beyond
        upright(axis, 8, 0, other, 1, 1),  # without height
    ]  # fmt: skip
    slope = mesh_of([(0, 0, 0), (10, 0, 0), (10, 10, 5), (0, 10, 5)], [(0, 1, 2), (0, 2, 3)])
    bounds = (x, y, x + 10, y + 6) if axis == 0 else (x, y, x + 6, y + 10)
    found = steps(moved(joined(slope, *walls), x, y), bounds)
    np.testing.assert_array_equal(found[axis], np.array([2.5, 7]) + UTM[axis])
    assert found[1 - axis].shape == (0,)


def test_a_wall_may_have_short_faces_beside_long_ones() -> None:
    """The short one ends far before the long one does, and the next begins."""
    parts = [(0, 6, 0, 1), (1, 2, 1, 3), (5, 10, 0, 1)]
    wall = joined(*(upright(0, 4.0, *part) for part in parts))
    assert steps(wall, (0, 0, 9, 10))[0].tolist() == [4]
    assert (
        steps(joined(*(upright(0, 4.0, *part) for part in parts[:2])), (0, 0, 9, 10))[0].size == 0
    )


def test_turned_walls_are_no_steps() -> None:
    wall = mesh_of([(0, 3, 0), (8, 4, 0), (8, 4, 2), (0, 3, 2)], [(0, 1, 2), (0, 2, 3)])
    assert [len(found) for found in steps(joined(GROUND, wall), (0, 0, 8, 6))] == [0, 0]
