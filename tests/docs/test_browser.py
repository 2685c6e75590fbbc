"""Pages as a browser shows them, opened from disk without a network (Chromium, by its DevTools protocol)."""

from __future__ import annotations

import asyncio
import base64
import io
import json
import re
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
import xarray as xr
from scenes import TRAIN, succeeds

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)
pytest.importorskip("bokeh")
websocket = pytest.importorskip("tornado.websocket")  # Bokeh brings it
pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium or Chrome")]

WIDTH, HEIGHT = 1200, 800
Y = 290
"""Where the pointer moves: in the middle of a row of cells."""
TEXTS = """(() => {
  const text = node => node.nodeType === 3 ? node.data
    : ["STYLE", "SCRIPT"].includes(node.tagName) ? ""
    : [...(node.shadowRoot ? node.shadowRoot.childNodes : []), ...node.childNodes].map(text).join(" ");
  return text(document.body);
})()"""
"""All text of a page, that in the parts of Bokeh too."""
HANDLE = """(() => {
  const find = node => node.querySelector(".noUi-handle")
    ?? [...node.querySelectorAll("*")].reduce((f, n) => f ?? (n.shadowRoot ? find(n.shadowRoot) : null), null);
  find(document).focus();
})()"""


class Tab:
    """A tab of a browser, the events that it told, and what one does in it."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.number, self.events = folder, 0, list[dict[str, Any]]()
        self.loop = asyncio.new_event_loop()

    def __enter__(self) -> Tab:
        assert CHROMIUM is not None
        flags = ["--headless=new", "--no-sandbox", "--no-first-run", "--disable-gpu", "--force-device-scale-factor=1"]
        place = [f"--user-data-dir={self.folder}", "--remote-debugging-port=0", f"--window-size={WIDTH},{HEIGHT}"]
        command = [CHROMIUM, *flags, *place, "about:blank"]
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            self.loop.run_until_complete(self.connect())
            for domain in ("Page", "Runtime", "Log", "Network"):
                self.call(f"{domain}.enable")
            none = {"latency": 0, "downloadThroughput": 0, "uploadThroughput": 0}
            self.call("Network.emulateNetworkConditions", offline=True, **none)
            size = {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False}
            self.call("Emulation.setDeviceMetricsOverride", **size)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        self.process.terminate()
        self.process.wait()
        if self.number:  # connected
            self.loop.run_until_complete(self.leave())
        self.loop.close()

    async def leave(self) -> None:
        self.socket.close()
        while await self.socket.read_message() is not None:
            pass

    async def connect(self) -> None:
        known = self.folder / "DevToolsActivePort"
        port = until(lambda: known.exists() and known.read_text()).split()[0]
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list") as answer:
            address = next(tab for tab in json.load(answer) if tab["type"] == "page")["webSocketDebuggerUrl"]
        self.socket = await websocket.websocket_connect(address, max_message_size=1 << 28)

    def call(self, method: str, **values: Any) -> dict[str, Any]:
        """Answer of the browser; what it tells meanwhile goes to the events."""
        return self.loop.run_until_complete(self.answer(method, values))

    async def answer(self, method: str, values: dict[str, Any]) -> dict[str, Any]:
        self.number += 1
        await self.socket.write_message(json.dumps({"id": self.number, "method": method, "params": values}))
        while True:
            told = json.loads(await self.socket.read_message())
            if told.get("id") == self.number:
                assert "error" not in told, told
                return told["result"]
            self.events.append(told)

    def value(self, code: str) -> Any:
        """The value of an expression in the page."""
        found = self.call("Runtime.evaluate", expression=code, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def open(self, page: Path) -> None:
        self.events.clear()
        self.call("Page.navigate", url=page.as_uri())
        until(lambda: self.value("document.readyState") == "complete")

    def complaints(self) -> list[str]:
        """Errors on the console, and addresses asked for beyond this disk."""
        wrong = [
            event for event in self.events
            if event["method"] == "Runtime.exceptionThrown"
            or (event["method"] == "Runtime.consoleAPICalled" and event["params"]["type"] == "error")
            or (event["method"] == "Log.entryAdded" and event["params"]["entry"]["level"] == "error")
        ]  # fmt: skip
        asked = [e["params"]["request"]["url"] for e in self.events if e["method"] == "Network.requestWillBeSent"]
        return [json.dumps(event)[:300] for event in wrong] + [
            url for url in asked if not url.startswith(("file:", "data:", "blob:"))
        ]

    def picture(self) -> np.ndarray:
        """Picture of the page, ``(rows, columns, 3)``."""
        data = base64.b64decode(self.call("Page.captureScreenshot")["data"])
        return matplotlib.image.imread(io.BytesIO(data))[..., :3]

    def mouse(self, kind: str, x: float, y: float, **values: Any) -> None:
        self.call("Input.dispatchMouseEvent", type=f"mouse{kind}", x=x, y=y, **values)

    def press(self, key: str) -> None:
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=39)

    def hovered(self, x: float, y: float) -> dict[str, str]:
        """Words beside the pointer."""
        self.mouse("Moved", x, y)
        self.value("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        rows = r"mesh frequency \(rad/s\): (.*?) epsilon: (.*?) growth rate \(1/s\): (.*?) region: (.*?) *$"
        found = re.search(rows, re.sub(r"\s+", " ", self.value(TEXTS)))
        assert found, self.value(TEXTS)
        return dict(zip(("frequency", "epsilon", "growth", "region"), found.groups(), strict=True))


def until(ready: Callable[[], Any]) -> Any:
    """Return the first true value."""
    end = time.monotonic() + 60
    while not (found := ready()):
        assert time.monotonic() < end, "the browser does not answer"
        time.sleep(0.05)
    return found


@pytest.fixture(scope="module")
def tab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    with Tab(tmp_path_factory.mktemp("browser")) as opened:
        yield opened


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map of three axes and its page."""
    path = tmp_path_factory.mktemp("page")
    sweep = "sweep:\n  mesh_frequency: {start: 4.0, stop: 7.0, num: 61}\n  epsilon: {start: 0.1, stop: 0.3, num: 9}\n"
    slices = "  meshes.first.contact_ratio: [1.3, 1.5]\nmethods: {floquet: {}, boundaries: {}}\n"
    (path / "train.yaml").write_text(TRAIN + sweep + slices)
    for command in (("sweep", "train.yaml", "-o", "train.h5"), ("plot", "train.h5", "-o", "map.html")):
        succeeds(*(path / word if "." in word else word for word in command))
    return path


def test_a_map_says_what_its_result_holds(tab: Tab, folder: Path) -> None:
    """Under the pointer, in both slices and after a zoom: growth rates and regions as in the file."""
    tab.open(folder / "map.html")
    until(lambda: tab.value("Bokeh.documents.length > 0 && Bokeh.documents[0].is_idle"))
    with xr.open_datatree(folder / "train.h5", engine="h5netcdf") as tree:
        growth = tree["floquet"]["growth_rate"].load()
        edges = tree["boundaries"].to_dataset().set_coords("label").load()
    pictures = [tab.picture()]
    for slice_ in (0, 1):
        words = set()
        for x in range(150, 1000, 50):
            said = tab.hovered(x, Y)
            place = {"mesh_frequency": float(said["frequency"]), "epsilon": float(said["epsilon"])}
            here = growth.isel({"meshes.first.contact_ratio": slice_})
            expected = float(here.sel(place, method="nearest"))
            shown = 0.0 if said["growth"] == "stable" else float(said["growth"])
            assert shown == pytest.approx(expected, rel=1e-3, abs=1e-12), said
            lower, upper = (
                edges["boundary_frequency"]
                .isel({"meshes.first.contact_ratio": slice_})
                .interp(epsilon=place["epsilon"])
                .sel(side=side)
                for side in ("lower", "upper")
            )
            inside = ((lower < place["mesh_frequency"]) & (place["mesh_frequency"] < upper)).values
            near = np.abs(np.stack([lower, upper]) - place["mesh_frequency"])
            if np.nanmin(near) > 0.02:
                assert said["region"] == (", ".join(map(str, edges["label"].values[inside])) or "none")
            words.add(said["region"])
        assert words == {"2w3", "none"}
        if slice_ == 0:
            tab.value(HANDLE)
            tab.press("ArrowRight")
            until(lambda: "contact_ratio : 1.5" in re.sub(r"\s+", " ", tab.value(TEXTS)).replace(": ", " : "))
            pictures.append(tab.picture())
    assert (pictures[0] != pictures[1]).any(axis=2).mean() > 0.01  # another map, not only another caption

    wide = [float(tab.hovered(x, Y)["frequency"]) for x in (300, 800)]
    tab.mouse("Wheel", 550, Y, deltaX=0, deltaY=-300)
    close = until(lambda: (now := [float(tab.hovered(x, Y)["frequency"]) for x in (300, 800)]) != wide and now)
    assert wide[0] < close[0] < close[1] < wide[1]
    assert tab.complaints() == []


def test_without_scripts_the_first_slice_shows(tab: Tab, folder: Path) -> None:
    """As where mail or a forge shows a page: in a frame that may run nothing."""
    frame = f'<iframe sandbox src="map.html" width="{WIDTH}" height="{HEIGHT}" style="border: 0"></iframe>'
    (folder / "frame.html").write_text(f'<body style="margin: 0">{frame}')
    (code,) = re.findall(r'<noscript><img .*?base64,(.*?)"', (folder / "map.html").read_text())
    image = matplotlib.image.imread(io.BytesIO(base64.b64decode(code)))[..., :3]
    rows, columns = image.shape[:2]
    assert image.std() > 0.05
    tab.open(folder / "frame.html")
    until(lambda: abs(tab.picture()[:rows, :columns] - image).max() < 0.02)


def test_a_report_is_whole(tab: Tab, tmp_path: Path) -> None:
    (tmp_path / "train.yaml").write_text(TRAIN + "sweep:\n  mesh_frequency: {start: 4.0, stop: 7.0, num: 11}\n")
    succeeds("report", tmp_path / "train.yaml", "-o", tmp_path / "report.html", "--set", "methods={floquet: {}}")
    tab.open(tmp_path / "report.html")
    widths = tab.value("[...document.images].map(image => image.complete ? image.naturalWidth : 0)")
    assert widths
    assert min(widths) > 500
    assert tab.value("document.documentElement.scrollWidth") <= WIDTH
    assert "2w3" in tab.value("document.body.innerText")
    assert tab.complaints() == []
