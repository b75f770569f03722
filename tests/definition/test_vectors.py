"""Long vectors of curves: read ahead of the other values, and to the same model."""

from __future__ import annotations

import json
import math
import pickle
import random
import struct
from collections.abc import Iterator
from typing import Any
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.definition import vectors
from terratool.definition.curves import SampledCurve
from terratool.definition.model import LARGEST, Definition
from terratool.definition.reader import Checked, check
from terratool.definition.summaries import summarise_curve
from terratool.definition.vectors import Vector, lift_vectors
from terratool.field.terrain import Terrain
from terratool.text.source import Source
from tests.budget import examples

LONG = ",".join(str(k % 7) for k in range(vectors.LEAST))


@pytest.fixture(autouse=True)
def of_any_length() -> Iterator[None]:
    """Short texts are looked at, too."""
    with mock.patch.object(vectors, "_LONG", 0):
        yield


def lifted(numbers: str) -> list[float] | None:
    """Numbers of a vector as they are lifted; None where they are left in the text."""
    with mock.patch.object(vectors, "LEAST", 1):
        text = lift_vectors(f'{{"x":[{numbers}]}}'.encode(), LARGEST)
    return list(text.vectors[0]) if text.vectors else None


def terrain(x: str, more: str = "") -> bytes:
    return (
        f'{{"size":[3,2],{more}"elemTypes":{{"b":{{"x":{x},"y":"tent"}}}},'
        f'"elemTree":{{"type":"b","vScale":1}}}}'
    ).encode()


def read(text: bytes) -> Checked:
    return check(Source("t.json", text))


def curve(checked: Checked) -> Any:
    assert isinstance(checked.definition, Definition), checked.findings
    return checked.definition.primitives["b"].x


NUMBERS = st.one_of(
    st.integers(-(10**19), 10**19).map(str),
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.floats(-1e6, 1e6).map(lambda z: f"{z:.3f}"),
    st.from_regex(r"-?(0|[1-9][0-9]{0,17})(\.[0-9]{1,17})?([eE][+-]?[0-9]{1,2})?", fullmatch=True),
)


@given(st.lists(NUMBERS, min_size=1, max_size=5), st.sampled_from([",", " , ", "\n,\t"]))
@settings(max_examples=examples(2000), deadline=None)
def test_numbers_are_those_of_python(numbers: list[str], comma: str) -> None:
    """To the last bit, or left to it."""
    found = lifted(comma.join(numbers))
    if found is None:
        assert any(
            abs(float(one)) > LARGEST or len(one) > 18 or "e" in one.lower() for one in numbers
        )
        return
    for text, one in zip(numbers, found, strict=True):
        wanted = float(json.loads(text))
        assert struct.pack("d", wanted) == struct.pack("d", one), text


def test_most_doubles_are_lifted() -> None:
    """Those of seventeen digits as those of one."""
    draw = random.Random(1)
    values = [draw.uniform(-1, 1) * 10 ** draw.randint(-9, 9) for _ in range(20_000)]
    assert lifted(",".join(map(repr, values))) == values


@pytest.mark.parametrize(
    "numbers",
    [
        "", "01", "+1", "1.", ".5", "1e", "1e+", "-", "--1", "1,,2", "1,", ",1", "1 2", "1.5.2",
        "1e2e3", "0x10", "NaN", "1e31", "-1e31", "1e400", "٣", "1,[2,3]", "1,null", '1,"2"',
        "1\v,2", "1_000", "12345678901234567890123",
    ],
)  # fmt: skip
def test_what_is_no_vector_stays(numbers: str) -> None:
    assert lifted(numbers) is None


@pytest.mark.parametrize(
    ("x", "more"),
    [
        (f"[{LONG}]", ""),
        (f"[ {LONG.replace(',', ' ,')}\n]", ""),
        (f"[{LONG},1e999]", ""),  # beyond floats
        (f"[{LONG},01]", ""),
        (f"[{LONG},]", ""),
        (f"[{LONG}", ""),
        (f"[{LONG},[0.5,1]]", ""),
        (f'[{LONG}],"x":[2]', ""),  # twice, and the last one counts
        (f'[2],"x":[{LONG}]', ""),
        (f'[{LONG}],"x":[{LONG}]', ""),
        (f"[{LONG}]", f'"x":[{LONG}],'),  # no key of terrains
        (f"[{LONG}]", f'"x-mine":{{"x":[{LONG}]}},'),
        (f"[{LONG}]", f'"crs":{{"y":[{LONG}]}},'),
        (f"[{LONG}]", '"x-ignore":["TT306"],'),
        (f"[{LONG}]", '"descr":"\\u0000vector 0",'),
        ('"\\u0000vector 0"', ""),
        ('"\\u0000vector 0"', f'"x-mine":{{"x":[{LONG}]}},'),
        (f"[{LONG}]", '"descr":"\\"x\\":[1,2]","crs":"EPSG:32633",'),
    ],
)
def test_findings_and_model_are_those_of_the_whole_text(x: str, more: str) -> None:
    text = terrain(x, more)
    one = read(text)
    with mock.patch.object(vectors, "_LONG", math.inf):
        other = read(text)
    assert one.findings == other.findings and one.counts == other.counts
    assert one.definition == other.definition


@pytest.mark.parametrize("count", [999, vectors.LEAST, 60_000])
@pytest.mark.parametrize("long", [0, math.inf])
def test_long_vectors_have_the_range_of_short_ones(count: int, long: float) -> None:
    text = terrain(json.dumps([0.5] * (count - 1) + [1e31]))
    with mock.patch.object(vectors, "_LONG", long):
        (finding,) = (one for one in read(text).findings if one.severity == "error")
    assert finding.code == "TT106" and finding.pointer == f"/elemTypes/b/x/{count - 1}"


def test_long_vectors_are_arrays_on_either_way() -> None:
    """So that they are equal whichever way they came, and never equal to a shorter one."""
    one = curve(read(terrain(f"[{LONG}]")))
    other = curve(read(terrain(f"[{LONG}]", '"descr":"\\u0000",')))
    assert type(one) is type(other) is Vector
    assert one == other and hash(one) == hash(other)
    assert type(curve(read(terrain("[1,0]")))) is tuple
    changed = curve(read(terrain(f"[{LONG[:-1]}9]")))
    assert one != changed
    assert pickle.loads(pickle.dumps(one)) == one
    zero = Vector(np.array([0.0, 1.0])), Vector(np.array([-0.0, 1.0]))
    assert zero[0] == zero[1] and hash(zero[0]) == hash(zero[1])


@given(st.lists(st.floats(-10, 10), min_size=2, max_size=9), st.booleans())
@settings(max_examples=examples(200), deadline=None)
def test_a_vector_is_what_its_tuple_is(values: list[float], mirrored: bool) -> None:
    """For summaries and for the field."""
    values = [*values, *values[::-1]] if mirrored else values
    array, plain = Vector(np.array(values)), tuple(values)
    assert summarise_curve(SampledCurve(array)) == summarise_curve(SampledCurve(plain))
    assert [*array] == [*plain] and [*reversed(array)] == [*reversed(plain)]
    assert array[1:] == Vector(np.array(plain[1:])) and array[-1] == plain[-1]
    for value in plain:
        assert array.index(value) == plain.index(value)
    with pytest.raises(ValueError, match="not in the vector"):
        array.index(11.0)
    text = terrain(json.dumps(values), '"x-ignore":["TT306"],')
    with mock.patch.object(vectors, "LEAST", 2):
        short = Terrain(read(text))
    x = np.linspace(0, 3, 50)
    wanted = Terrain(read(text)).height(x, np.full(50, 0.7))
    assert np.array_equal(short.height(x, np.full(50, 0.7)), wanted)


def test_only_texts_of_some_length_are_looked_at() -> None:
    with mock.patch.object(vectors, "_LONG", 100_000):
        assert lift_vectors(terrain(f"[{LONG}]"), LARGEST).vectors == ()


def test_vectors_that_differ_in_one_number_have_hashes_of_their_own() -> None:
    """Or compiling many of them would compare each with each."""
    arrays = np.zeros((500, 1200))
    arrays[np.arange(500), np.arange(500) + 3] = 1
    assert len({hash(Vector(array)) for array in arrays}) == 500
    assert hash(Vector(np.array([0.0, 1.0]))) == hash(Vector(np.array([-0.0, 1.0])))
