"""`terratool view` in a browser: what real pointers and keys get is what the terrain has."""

from __future__ import annotations

import json
import re
import subprocess
import time
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from terratool.traversability.verdicts import COLORS, GroundClass
from tests.commands import COMMAND, ENVIRONMENT, ROOT, SAMPLE, call
from tests.viewing.browsers import chromium

WAIT = 20.0
HUSKY = ROOT / "samples/vehicles/husky-a200.json"

# Oblong ground with a tall box in its south-east, a low one in its north-west, a ramp that rises
# to the east in its west, and a disc that is a hole in its north-east.
BOXES: dict[str, Any] = {
    "size": [12, 8],
    "descr": "</script><script>window.hacked = 1</script>",
    "surfTypes": {
        "ground": {"color": [90, 110, 90], "cohesion": 2, "fricAngle": 33, "sinkage": 0},
        "red": {"color": [230, 20, 20], "cohesion": 2, "fricAngle": 33, "sinkage": 0},
        "</script><b>blue": {
            "color": [20, 20, 230], "descr": "<img src=x onerror=window.hacked=2>"
        },
        "hole": {"void": True},
    },
    "elemTypes": {
        "block": {"x": [1]}, "ramp": {"x": [0, 1]}, "disc": {"x": [1], "combine": "radial"}
    },
    "elemTree": {
        "type": "block", "vScale": 1, "surface": "ground", "cells": [12, 8],
        "children": [
            {"cellX": 8, "cellY": 1, "span": [2, 2], "type": "block", "vScale": 3, "surface": "red",
             "descr": "</script>tall"},
            {"cellX": 1, "cellY": 5, "span": [3, 1], "type": "block", "vScale": 0.5,
             "surface": "</script><b>blue"},
            {"cellX": 1, "cellY": 3, "span": [4, 2], "type": "ramp", "vScale": 1.5},
            {"cellX": 9, "cellY": 5, "span": [2, 2], "type": "disc", "surface": "hole"},
        ],
    },
}  # fmt: skip


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with chromium(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


@pytest.fixture
def page(browser: Any, tmp_path: Path) -> Iterator[Callable[..., Page]]:
    """Writes the page of a file and opens it; at the end the page must have had no error."""

    def open_page(file: Path, *options: object) -> Page:
        out = tmp_path / f"{file.stem}.html"
        ran = call("view", file, "--output", out, "--no-open", *options)
        assert ran.code == 0, ran.err
        return Page(browser, out.as_uri())

    yield open_page
    severe = [log["message"] for log in browser.get_log("browser") if log["level"] == "SEVERE"]
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    assert severe == []


def test_all_of_it_is_in_view_whatever_the_window_is(
    page: Callable[..., Page], tmp_path: Path
) -> None:
    """As large as it fits, in the middle, in a wide window, a tall one, and one that is changed."""
    path = tmp_path / "flat.json"
    flat = {"size": [15, 8], "surfTypes": {"red": {"color": [230, 20, 20]}}}
    tree = {"elemTypes": {"b": {"x": [1]}}, "elemTree": {"type": "b", "surface": "red"}}
    path.write_text(json.dumps(flat | tree), "utf-8")
    shown = page(path)
    for width, height in ((1280, 800), (390, 844), (900, 500)):
        screen = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        shown.changed(
            lambda screen=screen: shown.browser.execute_cdp_cmd(
                "Emulation.setDeviceMetricsOverride", screen
            )
        )
        picture = shown.picture()
        tall, wide, _ = picture.shape
        left, top, right, bottom = extent(reddish(picture))
        assert left > 0 and top > 0 and right < wide and bottom < tall
        assert left + right == pytest.approx(wide, abs=0.02 * wide)
        assert top + bottom == pytest.approx(tall, abs=0.02 * tall)
        assert max((right - left) / wide, (bottom - top) / tall) > 0.9


@pytest.mark.nightly
def test_a_browser_without_webgl_is_told(tmp_path: Path) -> None:
    """And all but the picture is shown."""
    out = tmp_path / "a.html"
    assert call("view", SAMPLE, "--output", out, "--no-open").code == 0
    with chromium(tmp_path / "profile", options=("disable-3d-apis",)) as browser:
        browser.get(out.as_uri())
        end = time.monotonic() + WAIT
        script = "return document.body.dataset.shown"
        while browser.execute_script(script) is None:
            assert time.monotonic() < end
            time.sleep(0.01)
        assert browser.execute_script(script) == "no"
        text = browser.find_element("tag name", "body").text
    assert "This browser has no WebGL" in text and "Opening" not in text
    assert json.loads(Path(SAMPLE).read_text("utf-8"))["descr"] in text
    assert "faces" in text


@pytest.fixture
def boxes(tmp_path: Path) -> Path:
    path = tmp_path / "boxes.json"
    path.write_text(json.dumps(BOXES, indent=1), "utf-8")
    return path


class Page:
    """A page that is shown."""

    def __init__(self, browser: Any, url: str) -> None:
        self.browser = browser
        browser.get(url)
        self.until(lambda: self.browser.execute_script(
            "return document.readyState === 'complete' && Boolean(document.body.dataset.shown)"
        ))  # fmt: skip
        self.settle()
        browser.execute_script("document.querySelector('#north').style.display = 'none'")  # is red

    def until(self, holds: Callable[[], bool]) -> None:
        end = time.monotonic() + WAIT
        while not holds():
            assert time.monotonic() < end, self.browser.find_element("tag name", "body").text
            time.sleep(0.01)

    def changed(self, act: Callable[[], object]) -> None:
        """Do something, and let the page draw what comes of it."""
        act()
        self.settle()

    def settle(self) -> None:
        self.browser.execute_async_script(
            "const done = arguments[0], next = (n) => n ? requestAnimationFrame(() => next(n - 1))"
            " : setTimeout(done); next(3);"
        )

    def follow(self, version: int) -> None:
        """Wait until the page has heard of a version of its file, and has drawn it."""
        script = "return Number(document.body.dataset.version || 0)"
        self.until(lambda: self.browser.execute_script(script) >= version)
        self.settle()

    @property
    def view(self) -> Any:
        return self.browser.find_element("id", "view")

    def press(self, keys: str) -> None:
        for key in keys:
            self.changed(lambda key=key: self.view.send_keys(key))  # type: ignore[misc]

    def move(self, x: int, y: int, *, click: bool = False) -> dict[str, str]:
        """Move the pointer to a pixel of the view; what is said then."""
        from selenium.webdriver import ActionChains

        box = self.view.size
        chain = ActionChains(self.browser, duration=0).move_to_element_with_offset(
            self.view, x - box["width"] // 2, y - box["height"] // 2
        )
        self.browser.execute_script("document.querySelector('#readout').replaceChildren()")
        (chain.click() if click else chain).perform()
        return self.said()

    def said(self) -> dict[str, str]:
        self.settle()
        script = (
            "return Object.fromEntries([...document.querySelectorAll('#readout [data-key]')]"
            ".map((one) => [one.dataset.key, one.textContent]))"
        )
        return dict(self.browser.execute_script(script))

    def picture(self) -> NDArray[np.uint8]:
        """The pixels of the view, (height, width, 3)."""
        with Image.open(BytesIO(self.view.screenshot_as_png)) as image:
            return np.array(image.convert("RGB"))

    def listed(self) -> dict[str, str]:
        """What the panel says of the element that was picked."""
        script = (
            "const box = document.querySelector('#picked');"
            "return box.hidden ? {} : Object.fromEntries([...box.querySelectorAll('[data-key]')]"
            ".map((one) => [one.dataset.key, one.textContent]))"
        )
        return dict(self.browser.execute_script(script))

    def text(self, selector: str) -> str:
        return str(self.browser.find_element("css selector", selector).text)


# Pixels all over the view, away from its edges, and from those of elements on these samples.
SPOTS = [
    (61, 155), (157, 261), (207, 223), (251, 319), (331, 267), (373, 181), (437, 347), (491, 211),
    (553, 293), (617, 391),
]  # fmt: skip


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "options"),
    [("warehouse", ()), ("ramp-yard", ()), ("nested-site", ("--max-error", 0.02))],
)
def test_what_the_pointer_tells_is_what_a_query_answers(
    page: Callable[..., Page], name: str, options: tuple[object, ...]
) -> None:
    """z within the error that it says; surface, element, description and line exactly."""
    file = ROOT / f"samples/{name}.json"
    shown = page(file, *options)
    shown.press("t")
    [within] = map(float, re.findall(r"([\d.]+)° at 99 of 100 places", shown.text("#facts")))
    assert within < 12
    told = [shown.move(*spot) for spot in SPOTS]
    places = [one[key] for one in told for key in "xy"]
    answers = json.loads(call("query", file, *places, "--json").out)["points"]
    for one, answer in zip(told, answers, strict=True):
        assert abs(float(one["z"]) - answer["z"]) <= float(one["±"]) + 1e-9, one
        slope = np.degrees(np.arccos(answer["nz"]))
        assert abs(float(one["slope"].rstrip("°")) - slope) <= within + 0.05, one
        assert one["surface"] == answer["surface"], one
        assert one["element"] == answer["element"], one
        assert element_at(file, one["line"], answer["element"]) is not None, one
    assert len({one["element"] for one in told}) >= 4
    assert float(told[0]["±"]) < 0.025


def element_at(file: Path, line: str, name: str) -> Any:
    """The object that begins in a line and is what the end of a name points to; None if none is."""
    where, _, number = line.rpartition(":")
    text = (file if where == file.name else file.parent / where).read_text("utf-8")
    value = json.loads(text)
    pointer = name.rpartition("#")[2] if "#" in name else name
    for token in re.sub(r"\[[^\]]*\]", "", pointer).split("/")[1:]:
        value = value[int(token)] if isinstance(value, list) else value[token]
    begin = sum(map(len, text.splitlines(keepends=True)[: int(number) - 1]))
    end = text.index("\n", begin)
    for at in [found.start() for found in re.finditer(r"{", text[begin:end])]:
        if json.JSONDecoder().raw_decode(text, begin + at)[0] == value:
            return value
    return None


def reddish(picture: NDArray[np.uint8]) -> NDArray[np.bool_]:
    red, green, blue = np.moveaxis(picture.astype(int), -1, 0)
    return np.asarray((red > 90) & (green < red / 4) & (blue < red / 4))


def bluish(picture: NDArray[np.uint8]) -> NDArray[np.bool_]:
    return reddish(picture[..., ::-1])


def greenish(picture: NDArray[np.uint8]) -> NDArray[np.bool_]:
    red, green, blue = np.moveaxis(picture.astype(int), -1, 0)
    return np.asarray((green > 1.1 * red) & (green > 1.1 * blue))


def extent(mask: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """Left, top, right and bottom of what is marked."""
    rows, columns = np.nonzero(mask)
    return int(columns.min()), int(rows.min()), int(columns.max()) + 1, int(rows.max()) + 1


@pytest.mark.parametrize(
    ("key", "sides"),
    [
        ("s", (8 / 12, 10 / 12)), ("n", (2 / 12, 4 / 12)),
        ("e", (1 / 8, 3 / 8)), ("w", (5 / 8, 7 / 8)),
    ],
)  # fmt: skip
def test_walls_are_upright_where_they_are(
    page: Callable[..., Page], boxes: Path, key: str, sides: tuple[float, float]
) -> None:
    """Seen from a side the box is a rectangle as tall as it is, at its place and not at that in a
    mirror."""
    shown = page(boxes)
    shown.press(key)
    shown.move(3, 3)
    picture = shown.picture()
    # the frame of the terrain says where its sides are: it is as wide as all of it
    width = picture.shape[1]
    scale = width / 1.1 / (12 if key in "sn" else 8)
    wide = 12 if key in "sn" else 8
    if key in "ew":  # the height of the view is what limits it
        scale = min(scale, picture.shape[0] / 1.1 / 4)
    left, top, right, bottom = extent(reddish(picture))
    middle = width / 2
    expected = [middle + (share - 0.5) * wide * scale for share in sides]
    assert left == pytest.approx(expected[0], abs=2)
    assert right == pytest.approx(expected[1], abs=2)
    assert bottom - top == pytest.approx(3 * scale, abs=2)
    inside = reddish(picture)[top + 2 : bottom - 2, left + 2 : right - 2]
    assert inside.all()  # no ramp, no gap: upright from foot to top


def test_seen_from_above_all_is_where_it_is(page: Callable[..., Page], boxes: Path) -> None:
    """East is on the right and north on top; the hole is one."""
    shown = page(boxes)
    shown.press("t")
    picture = shown.picture()
    height, width, _ = picture.shape
    scale = min(width / 12, height / 8) / 1.1
    for mask, (west, south, east, north) in (
        (reddish(picture), (8, 1, 10, 3)),
        (bluish(picture), (1, 5, 4, 6)),
    ):
        left, top, right, bottom = extent(mask)
        assert (left - width / 2) / scale + 6 == pytest.approx(west, abs=0.05)
        assert (right - width / 2) / scale + 6 == pytest.approx(east, abs=0.05)
        assert 4 - (top - height / 2) / scale == pytest.approx(north, abs=0.05)
        assert 4 - (bottom - height / 2) / scale == pytest.approx(south, abs=0.05)
    at = lambda x, y: (round(width / 2 + (x - 6) * scale), round(height / 2 - (y - 4) * scale))  # noqa: E731
    assert shown.move(*at(10, 6)) == {}
    assert shown.move(*at(11.5, 6))["element"] == "/elemTree"
    assert shown.move(*at(3, 4))["slope"] == "20.6°"  # atan(1.5 / 4)


def test_a_wall_tells_its_heights(page: Callable[..., Page], boxes: Path) -> None:
    shown = page(boxes)
    shown.press("s")
    left, top, right, bottom = extent(reddish(shown.picture()))
    told = shown.move((left + right) // 2, (top + bottom) // 2)
    assert re.fullmatch(r"from 1\.0+ to 4\.0+", told["wall"])
    assert (told["surface"], told["element"]) == ("red", "/elemTree/children/0")
    assert float(told["y"]) == pytest.approx(1, abs=1e-3)
    assert float(told["z"]) == pytest.approx(2.5, abs=0.05)


def test_a_cut_opens_what_stands_over_other_ground(
    page: Callable[..., Page], tmp_path: Path
) -> None:
    """A roof from 3.5 to 4 hides the ground below it, until what is above 3 is cut away."""
    path = tmp_path / "roof.json"
    tree = {**BOXES["elemTree"], "children": [dict(BOXES["elemTree"]["children"][0])]}
    tree["children"][0]["deck"] = {"thickness": 0.5}
    path.write_text(json.dumps({**BOXES, "elemTree": tree}), "utf-8")
    shown = page(path)
    shown.press("t")
    left, top, right, bottom = extent(reddish(shown.picture()))
    middle = (left + right) // 2, (top + bottom) // 2
    told = shown.move(*middle)
    assert (told["element"], float(told["z"])) == ("/elemTree/children/0", 4)
    slide = (
        "const slider = document.querySelector('#cut input'); slider.value = 70;"
        " slider.dispatchEvent(new Event('input'))"
    )
    shown.changed(lambda: shown.browser.execute_script(slide))
    shown.press("[")
    assert float(shown.text("#cut output").removesuffix(" m")) == pytest.approx(1 + 0.68 * 3)
    assert not reddish(shown.picture()).any()
    told = shown.move(*middle)
    assert (told["element"], float(told["z"])) == ("/elemTree", 1)
    shown.changed(lambda: shown.browser.execute_script(slide.replace("70", "99")))
    shown.press("]")
    assert extent(reddish(shown.picture())) == (left, top, right, bottom)
    assert shown.text("#cut output") == ""
    shown.press("s")
    left, top, right, bottom = extent(reddish(shown.picture()))
    told = shown.move((left + right) // 2, (top + bottom) // 2)
    assert re.fullmatch(r"from 3\.50* to 4\.0+", told["wall"])
    from selenium.webdriver.common.keys import Keys

    for _ in range(4):
        shown.changed(lambda: shown.view.send_keys(Keys.ARROW_DOWN))
    left, top, right, bottom = extent(reddish(shown.picture()))
    told = shown.move((left + right) // 2, (top + 2 * bottom) // 3)
    assert (told["underside"], told["surface"]) == ("2.5000 m clear", "red")


def test_a_click_marks_an_element_and_lists_its_keys(
    page: Callable[..., Page], boxes: Path
) -> None:
    shown = page(boxes)
    shown.press("t")
    blue = bluish(shown.picture())
    left, top, right, bottom = extent(blue)
    shown.changed(lambda: shown.move((left + right) // 2, (top + bottom) // 2, click=True))
    listed = shown.listed()
    assert listed["path"] == "/elemTree/children/1"
    assert listed["key-vScale"] == "0.5"
    assert listed["key-span"] == "[3,1]"
    assert listed["key-surface"] == "</script><b>blue"
    assert listed["line"].startswith("boxes.json:")
    assert element_at(boxes, listed["line"], listed["path"])["vScale"] == 0.5
    marked = shown.picture()[top + 3 : bottom - 3, left + 3 : right - 3].astype(int)
    assert (marked[..., 0] > 60).all()  # it has become redder
    from selenium.webdriver.common.keys import Keys

    shown.changed(lambda: shown.view.send_keys(Keys.ESCAPE))
    assert shown.listed() == {}
    assert (bluish(shown.picture()) == blue).all()


def test_what_a_file_says_is_no_markup(page: Callable[..., Page], boxes: Path) -> None:
    shown = page(boxes)
    assert shown.text("#descr") == BOXES["descr"]
    assert "</script><b>blue" in shown.text("#legend")
    assert shown.browser.execute_script("return window.hacked") is None
    script = "return document.querySelectorAll('#panel b, #panel img, #panel script').length"
    assert shown.browser.execute_script(script) == 0


def test_layers_have_their_colours(page: Callable[..., Page], boxes: Path) -> None:
    """Heights by cividis, slopes by viridis, verdicts as the map has them, each at its place."""
    shown = page(boxes, "--vehicle", HUSKY)
    shown.press("t")
    height, width, _ = shown.picture().shape
    scale = min(width / 12, height / 8) / 1.1

    def color(x: float, y: float) -> list[int]:
        pixel = shown.picture()[
            round(height / 2 - (y - 4) * scale), round(width / 2 + (x - 6) * scale)
        ]
        return [int(part) for part in pixel]

    shown.press("l")
    assert color(0.5, 7.5) == pytest.approx([0x00, 0x22, 0x4E], abs=3)  # the lowest
    assert color(9, 2) == pytest.approx([0xFE, 0xE8, 0x38], abs=3)  # the highest
    shown.press("l")
    assert color(0.5, 7.5) == pytest.approx([0x44, 0x01, 0x54], abs=3)  # level
    assert color(3, 4)[1] > 100  # the ramp
    shown.press("l")
    for x, y, verdict in (
        (9, 2, GroundClass.CUT_OFF), (3, 2, GroundClass.GO), (2.5, 5.5, GroundClass.UNKNOWN)
    ):  # fmt: skip
        spot = round(width / 2 + (x - 6) * scale), round(height / 2 - (y - 4) * scale)
        assert shown.move(*spot)["verdict"] == verdict.label
        assert color(x, y) == pytest.approx(COLORS[verdict], abs=3)
        assert verdict.label in shown.text("#legend")
    # with a front end at the foot of the tall block, which lies to the east of x 8
    told = shown.move(round(width / 2 + 1.6 * scale), round(height / 2 + 2 * scale))
    assert (told["verdict"], told["worst heading"]) == ("go", "no-go")
    assert color(7.6, 2) == pytest.approx(COLORS[GroundClass.GO], abs=3)
    shown.press("l")
    assert color(7.6, 2) == pytest.approx(COLORS[GroundClass.NO_GO], abs=3)
    assert color(3, 2) == pytest.approx(COLORS[GroundClass.GO], abs=3)


def test_keys_alone_do_all(page: Callable[..., Page], boxes: Path) -> None:
    from selenium.webdriver.common.keys import Keys

    shown = page(boxes)
    shown.press("0")
    first = shown.picture()
    shown.press(Keys.ARROW_LEFT * 3 + Keys.ARROW_UP)
    turned = shown.picture()
    assert (first != turned).any()
    shown.press("0")
    assert (shown.picture() == first).all()
    shown.press("t" + "+" * 3)
    shown.changed(lambda: shown.view.send_keys(Keys.ENTER))
    assert shown.listed()["path"] == "/elemTree"
    assert [float(shown.said()[key]) for key in "xy"] == pytest.approx([6, 4], abs=0.02)
    shown.press("s>>>>")
    assert shown.text("#exaggeration output") == "1.8"
    # every control can be reached, and says what it is
    script = (
        "return [...document.querySelectorAll('button, input, canvas')].filter((one) => "
        "one.offsetParent && !(one.labels?.length || one.textContent.trim() || "
        "one.getAttribute('aria-label'))).length"
    )
    assert shown.browser.execute_script(script) == 0


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_a_phone(page: Callable[..., Page], boxes: Path, scheme: str) -> None:
    """At 390 pixels nothing is cut off, a tap tells, and the text stands out from its ground."""
    shown = page(boxes)
    browser = shown.browser
    browser.execute_cdp_cmd(
        "Emulation.setEmulatedMedia",
        {"features": [{"name": "prefers-color-scheme", "value": scheme}]},
    )
    shown.changed(
        lambda: browser.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True},
        )
    )
    assert browser.execute_script("return document.documentElement.scrollWidth") == 390
    small = shown.view.size
    shown.changed(lambda: browser.find_element("id", "handle").click())
    assert shown.view.size["height"] > small["height"] + 100
    shown.press("t")
    touch(browser, small["width"] // 2, shown.view.size["height"] // 2)
    shown.until(lambda: bool(shown.said()))
    assert shown.listed()["path"] == "/elemTree"
    script = (
        "const s = getComputedStyle(document.body);"
        "return [s.color, s.backgroundColor].map((c) => c.match(/\\d+/g).slice(0, 3).map(Number))"
    )
    ink, ground = (sum(one) for one in browser.execute_script(script))
    assert (ground > ink + 450) if scheme == "light" else (ink > ground + 450)


def touch(browser: Any, x: int, y: int) -> None:
    from selenium.webdriver.common.actions.action_builder import ActionBuilder
    from selenium.webdriver.common.actions.pointer_input import PointerInput

    finger = PointerInput("touch", "finger")
    actions = ActionBuilder(browser, mouse=finger, duration=0)
    actions.pointer_action.move_to_location(x, y).pointer_down().pointer_up()
    actions.perform()


@pytest.mark.nightly
def test_a_drag_turns_the_wheel_zooms_and_the_right_button_moves(
    page: Callable[..., Page], boxes: Path
) -> None:
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.actions.wheel_input import ScrollOrigin

    shown = page(boxes)
    shown.press("t")
    centre = extent(reddish(shown.picture()))
    origin = ScrollOrigin.from_element(shown.view)
    shown.changed(lambda: ActionChains(shown.browser).scroll_from_origin(origin, 0, -200).perform())
    nearer = extent(reddish(shown.picture()))
    assert nearer[2] - nearer[0] > 1.2 * (centre[2] - centre[0])
    from selenium.webdriver.common.keys import Keys

    drag = ActionChains(shown.browser, duration=0).key_down(Keys.SHIFT)
    drag.click_and_hold(shown.view).move_by_offset(-40, 25).release().key_up(Keys.SHIFT)
    shown.changed(lambda: drag.perform())
    moved = extent(reddish(shown.picture()))
    assert [moved[k] - nearer[k] for k in range(4)] == pytest.approx([-40, 25, -40, 25], abs=1)
    turned = ActionChains(shown.browser, duration=0).click_and_hold(shown.view)
    shown.changed(lambda: turned.move_by_offset(60, 0).release().perform())
    assert (extent(reddish(shown.picture())) != np.array(moved)).any()


@pytest.mark.nightly
def test_watching_a_file_through_save_break_and_mend(browser: Any, boxes: Path) -> None:
    """The picture follows a save and keeps its view; while the file is broken the last good one
    stays, with the findings; what the pointer tells is the field's own answer."""
    command = [*COMMAND, "view", str(boxes), "--watch", "--no-open"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT,
        env={**ENVIRONMENT, "PYTHONUNBUFFERED": "1"},
    ) as server:  # fmt: skip
        try:
            assert server.stdout is not None
            url = server.stdout.readline().split()[0]
            assert re.fullmatch(r"http://127\.0\.0\.1:\d+/", url)
            shown = Page(browser, url)
            shown.press("s")
            tall = extent(reddish(shown.picture()))
            changed = json.loads(json.dumps(BOXES))
            changed["elemTree"]["children"][0]["vScale"] = 1.5

            boxes.write_text(json.dumps(changed), "utf-8")
            shown.follow(2)
            low = extent(reddish(shown.picture()))
            assert low[::2] == tall[::2]  # the view is the same
            assert low[3] - low[1] == pytest.approx((tall[3] - tall[1]) / 2, abs=2)

            boxes.write_text(
                json.dumps(changed).replace('"size": [12, 8]', '"size": [12, -8]'), "utf-8"
            )
            shown.follow(3)
            assert browser.find_element("id", "broken").is_displayed()
            assert "TT106" in shown.text("#broken")
            assert "boxes.json:1:" in shown.text("#broken")
            boxes.write_text(json.dumps(changed)[:-1], "utf-8")
            shown.follow(4)
            assert "TT101" in shown.text("#broken")
            browser.execute_script("document.querySelector('#broken').style.display = 'none'")
            assert extent(reddish(shown.picture())) == low  # the last good picture
            browser.execute_script("document.querySelector('#broken').style.display = ''")

            changed["elemTree"]["children"][0]["vScale"] = 2.25
            boxes.write_text(json.dumps(changed), "utf-8")
            shown.follow(5)
            assert not browser.find_element("id", "broken").is_displayed()
            mended = extent(reddish(shown.picture()))
            assert mended[3] - mended[1] == pytest.approx((tall[3] - tall[1]) * 0.75, abs=2)

            # where too many pages are open, this one says so and asks again
            browser.execute_script(
                "window.kept = window.fetch;"
                "window.fetch = async () => new Response('', { status: 503 })"
            )
            boxes.write_text(json.dumps(changed, indent=2), "utf-8")
            shown.until(lambda: "There are too many pages." in shown.text("#busy"))
            browser.execute_script("window.fetch = window.kept")
            shown.follow(6)
            assert shown.text("#busy") == ""

            shown.press("t")
            box = shown.view.size
            scale = min(box["width"] / 12, box["height"] / 8) / 1.1
            shown.move(
                round(box["width"] / 2 - 3.4 * scale), round(box["height"] / 2 + 0.2 * scale)
            )
            shown.until(
                lambda: browser.find_element("id", "readout").get_attribute("data-exact") == "yes"
            )
            told = shown.said()
            [answer] = json.loads(call("query", boxes, told["x"], told["y"], "--json").out)[
                "points"
            ]
            assert float(told["z"]) == pytest.approx(answer["z"], abs=1e-9)
            assert told["element"] == answer["element"] == "/elemTree/children/2"
        finally:
            server.kill()
