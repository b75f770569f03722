"""Commands on files that name addresses, in a net of its own where every address is this machine.

Run in a namespace: `unshare -rnm python tests/listener.py FOLDER`. All ports that matter and the
questions for names are listened to; it is tried first that a connection is heard.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import threading
import time
import urllib.request
import zipfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

PORTS = (21, 80, 443, 8080, 8799)
ADDRESSES = ("http://127.0.0.1:8799/a", "https://example.com/a", "http://10.9.8.7/a")
heard: list[str] = []


def listen() -> None:
    """Make every address this machine, and hear what comes to it."""
    for words in (
        "link set lo up", "route add local 0.0.0.0/0 dev lo", "-6 route add local ::/0 dev lo",
    ):  # fmt: skip
        subprocess.run(["ip", *words.split()], check="link" in words, capture_output=True)
    resolver = Path(sys.argv[1]) / "resolv.conf"
    resolver.write_text("nameserver 127.0.0.1\noptions timeout:1 attempts:1\n")
    subprocess.run(["mount", "--bind", resolver, "/etc/resolv.conf"], check=True)
    for port in PORTS:
        server = socket.create_server(("", port), family=socket.AF_INET6, dualstack_ipv6=True)
        threading.Thread(target=accept, args=(server, port), daemon=True).start()
    names = socket.socket(socket.AF_INET6, socket.SOCK_DGRAM)
    names.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 0)
    names.bind(("", 53))
    threading.Thread(target=questions, args=(names,), daemon=True).start()


def accept(server: socket.socket, port: int) -> None:
    while True:
        connection, _ = server.accept()
        heard.append(f"port {port}")
        connection.close()


def questions(names: socket.socket) -> None:
    """Each name is at 10.1.1.1."""
    while True:
        data, sender = names.recvfrom(2000)
        heard.append(f"question {data[12:40]!r}")
        answer = b"\xc0\x0c\x00\x01\x00\x01\x00\x00\x00\x3c\x00\x04\x0a\x01\x01\x01"
        names.sendto(data[:2] + b"\x81\x80\0\1\0\1\0\0\0\0" + data[12:] + answer, sender)


def files(folder: Path, address: str) -> Iterator[list[str]]:
    """Commands on files that name an address wherever a format lets them."""

    def put(name: str, text: str) -> str:
        (folder / name).write_text(text)
        return str(folder / name)

    terrain = {"size": [3, 2], "elemTypes": {"a": {"x": [0, 1]}}, "elemTree": {"type": "a"}}
    crses = [address, f"+proj=longlat +nadgrids={address}", f"+init={address}", {"$ref": address}]
    for number, crs in enumerate(crses):
        name = put(f"crs{number}.json", json.dumps({**terrain, "crs": crs, "$schema": address}))
        yield ["validate", name]
        yield ["export-dem", name, str(folder / f"crs{number}.tif"), "--resolution", "1"]
    vrt = """<VRTDataset rasterXSize="3" rasterYSize="2"><VRTRasterBand dataType="Float32" band="1">
<SimpleSource><SourceFilename relativeToVRT="0">{}</SourceFilename><SourceBand>1</SourceBand>
</SimpleSource></VRTRasterBand></VRTDataset>"""
    wms = f"""<GDAL_WMS><Service name="TMS"><ServerUrl>{address}/${{z}}/${{x}}/${{y}}.png</ServerUrl>
</Service><DataWindow><UpperLeftX>-1</UpperLeftX><UpperLeftY>1</UpperLeftY><LowerRightX>1</LowerRightX>
<LowerRightY>-1</LowerRightY><TileLevel>1</TileLevel></DataWindow><BandsCount>1</BandsCount></GDAL_WMS>"""
    entity = f'<!DOCTYPE a SYSTEM "{address}" [<!ENTITY b SYSTEM "{address}">]>'
    x3d = f'<?xml version="1.0"?>{entity}<X3D><Scene><Inline url=\'"{address}"\'/>&b;</Scene></X3D>'
    gltf = {
        "asset": {"version": "2.0"}, "buffers": [{"uri": address, "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}], "images": [{"uri": address}],
    }  # fmt: skip
    triangle = f"mtllib {address}\nv 0 0 0\nv 1 0 1\nv 0 1 0\nf 1 2 3\n"
    grid = "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2\n3 4\n"
    (folder / "asc.prj").write_text(
        f'PROJCS["x",EXTENSION["PROJ4","+proj=longlat +nadgrids={address}"]]'
    )
    sources = [
        put("curl.vrt", vrt.format(f"/vsicurl/{address}")), put("plain.vrt", vrt.format(address)),
        put("wms.xml", wms), put("wms.tif", wms), put("tile.json", json.dumps({"tiles": [address]})),
        put("entity.vrt", entity + vrt.format("&b;")), put("a.x3d", x3d), put("asc.asc", grid),
        put("a.wrl", f'#VRML V2.0 utf8\nInline {{ url "{address}" }}\n'),
        put("b.wrl", f'#VRML V2.0 utf8\nEXTERNPROTO A [] "{address}"\nA {{}}\n'),
        put("a.gltf", json.dumps(gltf)), put("a.obj", triangle), put("a.dae", x3d),
        address, f"/vsicurl/{address}", f"/vsizip//vsicurl/{address}", f"NETCDF:{address}",
        f"WMS:{address}", f"vrt://{address}", f"zip+{address}", f"/vsis3/{address}",
        f"GTIFF_DIR:1:{address}", f"STACTA:{address}",
    ]  # fmt: skip
    with zipfile.ZipFile(folder / "a.3mf", "w") as archive:
        archive.writestr("3D/3dmodel.model", entity + "<model>&b;</model>")
    for number, source in enumerate([*sources, str(folder / "a.3mf")]):
        out = str(folder / f"out{number}.json")
        yield ["import-terrain", source, out, "--max-error", "1"]
        yield ["import-primitive", source, "--name", "x"]
    yield ["validate", address]
    yield ["query", address, "1", "1"]


def main() -> None:
    """Listen, try that this works, run the commands, and say how many connections were heard."""
    folder = Path(sys.argv[1])
    listen()
    for address in ADDRESSES:
        before = len(heard)
        with suppress(OSError):
            urllib.request.urlopen(address, timeout=3)
        time.sleep(0.2)
        if len(heard) == before:
            sys.exit(f"a connection to {address} is not heard")
    environment = {**os.environ, "GDAL_HTTP_TIMEOUT": "2", "no_proxy": "*"}

    def run(*words: str) -> None:
        subprocess.run(
            [sys.executable, "-m", "terratool", *words],
            capture_output=True, env=environment, check=False,
        )  # fmt: skip

    heard.clear()
    run("import-primitive", f"/vsicurl/{ADDRESSES[0]}", "--name", "x", "--allow-remote")
    if not heard:
        sys.exit("what is allowed is not heard")
    heard.clear()
    count = 0
    for number, address in enumerate(ADDRESSES):
        (folder / str(number)).mkdir()
        for words in files(folder / str(number), address):
            before = len(heard)
            run(*words)
            count += 1
            if len(heard) > before:
                sys.stderr.write(f"{words}: {heard[before:]}\n")
    print(f"{count} commands, {len(heard)} connections")


if __name__ == "__main__":
    main()
