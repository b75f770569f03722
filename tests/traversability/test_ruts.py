"""`terratool deform`: what wheels leave behind, as the field has it afterwards."""

from __future__ import annotations

import gzip
import json
import math
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from terratool.definition.presets import preset_of
from terratool.definition.reader import Checked, load_checked
from terratool.errors import MissedError, RequestError
from terratool.field.terrain import Terrain, load
from terratool.traversability.ruts import (
    Deformed,
    DeformOptions,
    deform,
    simplify,
    wheel_paths,
    write_deformed,
)
from terratool.traversability.soil import bekker_sinkage
from terratool.traversability.vehicle import Axle, Vehicle, Wheel
from terratool.traversability.vehicle_files import load_vehicle
from tests.commands import ROOT, call

WHEEL = Wheel(radius=0.2, width=0.1)


def vehicle(*axles: Axle, mass: float = 40.0, track: float = 0.8) -> Vehicle:
    axles = axles or (Axle(0.5), Axle(-0.5))
    return Vehicle(WHEEL, axles, mass, 10.0, track_width=track, cog_height=0.3, clearance=0.2)


def flat(tmp_path: Path, **more: Any) -> Path:
    """40 × 30 m; the western half sand, the eastern one rock, a patch of mud and a hole."""
    plain = {"type": "plain", "vScale": 0}
    definition: dict[str, Any] = {
        "size": [40, 30],
        "surfTypes": {
            "sand": {"cohesion": 1, "fricAngle": 30, "sinkage": 0.1},
            "rock": {"cohesion": 0, "fricAngle": 40, "sinkage": 0},
            "dust": {"preset": "lunar-nominal"},
            "mud": {"cohesion": 5, "fricAngle": 5, "sinkage": 2.5},
            "lawn": {"cohesion": 5, "fricAngle": 5},
            "hole": {"void": True},
        },
        "elemTypes": {"plain": {"x": [1, 1]}},
        "elemTree": {
            **plain, "surface": "sand", "cells": [40, 30],
            "children": [
                {**plain, "surface": "rock", "cellX": 20, "cellY": 0, "span": [20, 30]},
                {**plain, "surface": "mud", "cellX": 0, "cellY": 28, "span": [5, 2]},
                {**plain, "surface": "hole", "cellX": 10, "cellY": 28, "span": [5, 2]},
                {**plain, "surface": "dust", "cellX": 20, "cellY": 0, "span": [20, 5]},
                {**plain, "surface": "lawn", "cellX": 35, "cellY": 25, "span": [5, 5]},
            ],
        },
        **more,
    }  # fmt: skip
    path = tmp_path / "flat.json"
    path.write_text(json.dumps(definition, indent=3), encoding="utf-8")
    return path


def driven(path: Path, route: Any, machine: Vehicle | None = None, **options: Any) -> Terrain:
    """The terrain after a drive."""
    site = load_checked(path)
    wanted = DeformOptions(**options)
    result = deform(site, machine or vehicle(), np.array(route, float), wanted)
    return Terrain(rutted(site, result))


def rutted(site: Checked, result: Deformed) -> Checked:
    """A terrain with the tracks that a drive leaves."""
    assert site.terrain is not None
    terrain = msgspec.structs.replace(site.terrain, tracks=result.tracks)
    return msgspec.structs.replace(site, terrain=terrain)


class TestLines:
    """Where wheels roll."""

    def test_straight_north(self) -> None:
        """A tricycle that drives north: one wheel ahead in the middle, two behind at its sides."""
        tricycle = vehicle(Axle(0.7, wheels=1), Axle(-0.3))
        lines = wheel_paths(tricycle, np.array([[5.0, 2.0], [5.0, 9.0]]), 0.01)
        assert [wheel for wheel, _ in lines] == [0, 1, 2]
        # the middle of the wheelbase is on the path, 0.5 m behind the front axle
        expected = [[(5, 2.5), (5, 9.5)], [(4.6, 1.5), (4.6, 8.5)], [(5.4, 1.5), (5.4, 8.5)]]
        for (_, line), points in zip(lines, expected, strict=True):
            assert np.allclose(line, points, atol=1e-12)

    def test_straight_east(self) -> None:
        """The left wheels of what drives east are north of the path."""
        lines = [line for _, line in wheel_paths(vehicle(), np.array([[0.0, 0], [8, 0]]), 0.01)]
        assert np.allclose(lines[0], [(0.5, 0.4), (8.5, 0.4)])
        assert np.allclose(lines[3], [(-0.5, -0.4), (7.5, -0.4)])

    def test_circle(self) -> None:
        """On a circle a rigid body's wheels run on circles about the same centre."""
        angle = np.linspace(0, 1.5 * math.pi, 300)
        circle = 6.0 * np.column_stack([np.sin(angle), np.cos(angle)])  # clockwise, from the north
        machine = vehicle(Axle(0.5), Axle(0.0), Axle(-0.5))
        radii = [np.hypot(*line[1:-1].T) for _, line in wheel_paths(machine, circle, 1e-4)]
        outer, inner = 6.4, 5.6
        for found, radius in zip(radii, [math.hypot(outer, 0.5), math.hypot(inner, 0.5), outer,
                                         inner, math.hypot(outer, 0.5), math.hypot(inner, 0.5)],
                                 strict=True):  # fmt: skip
            assert np.allclose(found, radius, atol=2e-3)

    def test_corner(self) -> None:
        """A sharp corner is turned on the spot: the wheels run round it at their distance."""
        route = np.array([[0.0, 0], [0, 10], [10, 10]])
        for _, line in wheel_paths(vehicle(), route, 1e-3):
            away = np.hypot(*(line - (0, 10)).T)
            turning = np.abs(away - math.hypot(0.5, 0.4)) < 2e-3
            assert turning.sum() >= 9  # 90° in steps of 10°

    def test_simplified(self) -> None:
        """No vertex is farther from what is left than the tolerance, and fewer are left."""
        rng = np.random.default_rng(1)
        line = np.cumsum(rng.normal(size=(200, 2)), axis=0)
        few = simplify(line, 0.7)
        assert 2 < len(few) < 150
        legs = list(pairwise(few))

        def away(point: Any) -> float:
            def one(begin: Any, end: Any) -> float:
                t = np.clip((point - begin) @ (end - begin) / ((end - begin) ** 2).sum(), 0, 1)
                return float(np.hypot(*(point - begin - t * (end - begin))))

            return min(one(*leg) for leg in legs)

        assert max(map(away, line)) <= 0.7 + 1e-12


class TestRuts:
    """What the field has where wheels have been."""

    def test_depth(self, tmp_path: Path) -> None:
        """z = k·W for one wheel over a place; where two have been, n^(1/3) times that."""
        path = flat(tmp_path)
        terrain = driven(path, [(4, 10), (12, 10)])
        once = 0.1e-3 * 100.0  # 40 kg by 10 m/s² on 4 wheels, k = 0.1 m/kN
        # the rear wheels alone have been at the start, all four in the middle
        assert terrain.height(3.6, 10.4) == pytest.approx(-once, rel=1e-6)
        assert terrain.height(8.0, 10.4) == pytest.approx(-once * 2 ** (1 / 3), rel=1e-6)
        assert terrain.height(8.0, 9.6) == terrain.height(8.0, 10.4)
        for y in (10.4 + 0.051, 10.4 - 0.051, 10.0, 9.6 + 0.051, 9.6 - 0.051):
            assert terrain.height(8.0, y) == 0.0
        for y in (10.4 + 0.049, 10.4 - 0.049):
            assert terrain.height(8.0, y) < 0.0

    def test_uneven_loads(self, tmp_path: Path) -> None:
        """Wheels near to the centre of gravity sink deeper, all by their own load."""
        machine = vehicle(Axle(0.25), Axle(-0.75))
        terrain = driven(flat(tmp_path), [(4, 10), (12, 10)], machine)
        front, rear = 400 * 0.75 / 2, 400 * 0.25 / 2
        assert terrain.height(12.5, 10.4) == pytest.approx(-0.1e-3 * front, rel=1e-6)
        assert terrain.height(3.5, 10.4) == pytest.approx(-0.1e-3 * rear, rel=1e-6)

    def test_passes(self, tmp_path: Path) -> None:
        """Eight passes of all four wheels are sixteen over a place."""
        terrain = driven(flat(tmp_path), [(4, 10), (12, 10)], passes=8, multipass=2)
        assert terrain.height(8.0, 10.4) == pytest.approx(-0.01 * 4, rel=1e-6)

    def test_each_axle_leaves_the_track_of_its_own_wheels(self, tmp_path: Path) -> None:
        """A narrow castor of a small radius: its width, and its depth by the soil's preset."""
        castor = Wheel(radius=0.08, width=0.04)
        machine = vehicle(Axle(0.3), Axle(-0.6, 1, False, castor))
        site = load_checked(flat(tmp_path))
        found = deform(site, machine, np.array([(5.0, 2.0), (5.0, 20.0)]))
        assert sorted(track.width for track in found.tracks) == [0.04, 0.1, 0.1]
        dust = deform(site, machine, np.array([(25.0, 2.0), (33.0, 2.0)]))
        soil = load_checked(flat(tmp_path)).terrain.surfaces["dust"]  # type: ignore[union-attr]
        preset = preset_of(soil)
        assert preset is not None
        for track in dust.tracks:
            wheel = castor if track.width == 0.04 else WHEEL
            depth = bekker_sinkage(preset, wheel, 1e3 * track.load)
            assert track.depth == {"dust": pytest.approx(depth, rel=1e-5)}

    def test_a_small_wheel_cannot_sink_by_its_own_radius(self, tmp_path: Path) -> None:
        """Under 133 N and more it sinks 13 mm, which a wheel of 0.2 m bears."""
        machine = vehicle(Axle(0.3), Axle(-0.6, 1, False, Wheel(0.01, 0.1)), mass=40.0)
        with pytest.raises(MissedError, match=r"its radius is 0\.01 m"):
            driven(flat(tmp_path), [(5, 2), (5, 20)], machine)

    def test_rigid(self, tmp_path: Path) -> None:
        """On rock there is nothing to see."""
        terrain = driven(flat(tmp_path), [(4, 10), (30, 10)])
        assert terrain.height(19.99, 10.4) < 0.0
        assert terrain.height(20.01, 10.4) == 0.0

    def test_only_wheels_leave_ruts(self, tmp_path: Path) -> None:
        """Tracks are refused in a sentence, before anything is done."""
        crawler = load_vehicle(ROOT / "samples/vehicles/superdroid-hd2.json")
        with pytest.raises(RequestError, match="stands on tracks") as raised:
            driven(flat(tmp_path), [(25, 2), (30, 2)], crawler)
        assert "vehicle on wheels" in raised.value.hint

    def test_preset(self, tmp_path: Path) -> None:
        """Of a preset it is Bekker's sinkage for this wheel, of which each half bears half."""
        terrain = driven(flat(tmp_path), [(25, 2), (30, 2)])
        # n = 1, kc = 1.4 kN/m², kφ = 820 kN/m³ (Wong 2008)
        bekker = (3 * 50 / ((3 - 1) * (1.4e3 + 0.1 * 820e3) * math.sqrt(0.4))) ** (2 / 3)
        assert bekker == pytest.approx(0.2007e-3 * 100 / 2 ** (2 / 3), rel=1e-3)
        assert terrain.height(30.4, 2.4) == pytest.approx(-bekker, rel=1e-5)

    def test_surface(self, tmp_path: Path) -> None:
        """The ruts can have a surface, and a query names the track."""
        terrain = driven(flat(tmp_path), [(4, 10), (12, 10)], surface="rock")
        assert terrain.surface(8.0, 10.4) == "rock"
        assert str(terrain.element(8.0, 10.4)).startswith("/tracks/")
        assert terrain.surface(8.0, 10.0) == "sand"

    def test_driven_again(self, tmp_path: Path) -> None:
        """The same path once more adds passes, and no tracks."""
        site = load_checked(flat(tmp_path))
        route = np.array([(4.0, 10.0), (12.0, 10.0)])
        first = deform(site, vehicle(), route)
        second = deform(rutted(site, first), vehicle(), route)
        assert (second.added, second.again, len(second.tracks)) == (0, 4, 4)
        assert [track.passes for track in second.tracks] == [2] * 4
        terrain = Terrain(rutted(site, second))
        assert terrain.height(8.0, 10.4) == pytest.approx(-0.01 * 4 ** (1 / 3), rel=1e-6)


class TestRefused:
    """One sentence, and nothing is written."""

    @pytest.mark.parametrize(
        ("route", "error", "says"),
        [
            ([(4, 10), (39.8, 10)], RequestError, "outside of the terrain"),
            ([(8, 29), (18, 29)], RequestError, "over no ground"),
            ([(34, 27), (38, 27)], RequestError, "'lawn'|\"lawn\""),
            ([(2, 29), (4, 29)], MissedError, "its radius is"),
            ([(2, 3), (2, 3)], RequestError, "fewer than two"),
        ],
    )
    def test_paths(self, tmp_path: Path, route: Any, error: type[Exception], says: str) -> None:
        with pytest.raises(error, match=says):
            driven(flat(tmp_path), route)

    def test_place_far_from_zero(self, tmp_path: Path) -> None:
        """Half a wheel's track beside the end of the path, to the millimetre."""
        site = flat(tmp_path)
        value = json.loads(site.read_text("utf-8")) | {"origin": [575054, 4429710]}
        site.write_text(json.dumps(value), "utf-8")
        with pytest.raises(RequestError) as raised:
            driven(site, [(575058, 4429720), (575093.8, 4429720)])
        found = re.search(r"terrain at (\S+) (\S+)\. ", str(raised.value))
        assert found is not None
        x, y = map(float, found.groups())
        assert x > 575094 and 0.01 < abs(y - 4429720) < 2.0

    def test_unknown_surface(self, tmp_path: Path) -> None:
        with pytest.raises(RequestError, match="mars"):
            driven(flat(tmp_path), [(4, 10), (12, 10)], surface="mars")

    def test_no_surface(self, tmp_path: Path) -> None:
        path = flat(tmp_path, elemTree={"type": "plain", "vScale": 0})
        with pytest.raises(RequestError, match="has no surface"):
            driven(path, [(4, 10), (12, 10)])


def command(folder: Path, out: Path, points: str = "x,y\n4,10\n12,10\n") -> tuple[object, ...]:
    """Drive a wheel over `flat`, with the points of a file."""
    path = folder / "path.csv"
    path.write_text(points, encoding="utf-8")
    wheel = ("--wheel-radius", "0.2", "--wheel-width", "0.1", "--load", "100")
    return "deform", flat(folder), *wheel, "--waypoints", path, "--output", out


class TestText:
    """What becomes of the file."""

    def test_rest_stays(self, tmp_path: Path) -> None:
        """Without its tracks the new text is the old one, byte for byte."""
        path, out = flat(tmp_path), tmp_path / "out.json"
        done = deform(load_checked(path), vehicle(), np.array([(4.0, 10.0), (12.0, 10.0)]))
        grown = write_deformed(str(path), out, done)
        before, after = path.read_bytes(), out.read_bytes()
        assert len(after) - len(before) == grown
        begin = after.index(b'"tracks"')
        assert before.startswith(after[:begin].rstrip()[:-1])  # without the comma
        assert json.loads(after)["tracks"][0]["load"] == 0.1
        load(out)

    def test_thousand_metres(self, tmp_path: Path) -> None:
        """A thousand metres of winding rut cost some five kilobytes."""
        y = np.linspace(0, 900, 2000)
        x = 50 + 20 * np.sin(y / 40)
        route = np.column_stack([x, y + 20])
        path = flat(tmp_path, size=[100, 1000])
        done = deform(load_checked(path), vehicle(), route)
        grown = write_deformed(str(path), tmp_path / "out.json", done)
        assert done.length > 3800
        assert grown / done.length < 6.0

    def test_command(self, tmp_path: Path) -> None:
        """The command writes what Python does, and says how deep."""
        out = tmp_path / "out.json"
        deform = command(tmp_path, out)
        result = call(*deform, "--json")
        assert result.code == 0
        assert json.loads(result.out)["surfaces"] == [
            {"surface": "sand", "length": pytest.approx(8.0), "depth": pytest.approx(0.01)}
        ]
        assert load(out).height(8.0, 10.0) == pytest.approx(-0.01)
        again = call(*deform)
        assert again.code == 3 and "--overwrite" in again.err
        own = call("deform", out, *deform[2:], "--overwrite")
        assert own.code == 0
        assert load(out).height(8.0, 10.0) == pytest.approx(-0.01 * 2 ** (1 / 3))

    @pytest.mark.parametrize("name", ["own.json", "own.json.gz", "packed.json"])
    def test_in_place(self, tmp_path: Path, name: str) -> None:
        """Without -o the file itself gets the tracks; it stays packed or plain."""
        out, own = tmp_path / "out.json", tmp_path / name
        words = command(tmp_path, out)
        packed = name != "own.json"
        before = Path(str(words[1])).read_bytes()
        own.write_bytes(gzip.compress(before) if packed else before)
        assert call(*words).code == 0
        assert call("deform", own, *words[2:-2]).code == 0
        after = own.read_bytes()
        assert (gzip.decompress(after) if packed else after) == out.read_bytes() != before

    def test_standard_input_has_no_place(self, tmp_path: Path) -> None:
        words = command(tmp_path, tmp_path / "out.json")
        result = call("deform", "-", *words[2:-2], stdin=Path(str(words[1])).read_bytes())
        assert result.code == 2 and "-o OUT" in result.err

    def test_nothing_is_written(self, tmp_path: Path) -> None:
        out = tmp_path / "out.json"
        result = call(*command(tmp_path, out, "4,10\n12,80\n"))
        assert result.code == 2 and "outside the terrain" in result.err
        assert not out.exists()

    @pytest.mark.parametrize("which", ["path.csv", "rover.json"])
    def test_what_is_read_is_not_overwritten(self, tmp_path: Path, which: str) -> None:
        rover, out = tmp_path / "rover.json", tmp_path / which
        rover.write_bytes((ROOT / "samples" / "vehicles" / "husky-a200.json").read_bytes())
        deform, file, *_, path, option, _ = command(tmp_path, out)
        before = out.read_bytes()
        arguments = ("--vehicle", rover, "--waypoints", path, option, out, "--overwrite")
        result = call(deform, file, *arguments)
        assert result.code == 3 and "is read, too" in result.err
        assert out.read_bytes() == before

    @pytest.mark.parametrize(
        ("option", "value"),
        [("--max-error", "nan"), ("--max-error", "inf"), ("--multipass", "nan"),
         ("--multipass", "inf"), ("--passes", "99999999999")],
    )  # fmt: skip
    def test_numbers_that_are_none(self, tmp_path: Path, option: str, value: str) -> None:
        out = tmp_path / "out.json"
        result = call(*command(tmp_path, out), option, value)
        assert result.code == 2 and option in result.err
        assert not out.exists()

    def test_a_coarse_tolerance_does_not_move_lines(self, tmp_path: Path) -> None:
        """It leaves out vertices; the wheels of both sides stay apart, and where they are."""
        site = load_checked(flat(tmp_path))
        path = np.array([[4.3, 10.3], [12.3, 10.3]])
        done = deform(site, vehicle(), path, DeformOptions(max_error=50.0))
        sides = {round(float(y), 3) for track in done.tracks for _, y in track.path}
        assert sides == {9.9, 10.7}
