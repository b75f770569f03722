"""Reading meshes: large arrays of VRML97 against NumPy, plain Python and reading a ready array.

All on one thread, the same text in the same run.
"""

from __future__ import annotations

import tempfile
import warnings
from pathlib import Path

import numpy as np
from measure import line, medians

from terratool.importing.vrml.scene import read_vrml
from terratool.importing.vrml.text import VrmlText

POINTS = 400_000


def numbers(name: str, words: str) -> None:
    """Compare the reading of one run of numbers."""
    plain = words.replace(",", " ")
    text = VrmlText("text.wrl", words.encode())

    def ours() -> np.ndarray:
        text.at = 0
        return text.run()

    def numpys() -> np.ndarray:
        with warnings.catch_warnings():  # it says that it does not like binary input
            warnings.simplefilter("ignore")
            return np.fromstring(plain, sep=" ")

    def pythons() -> list[float]:
        return [float(word) for word in plain.split()]

    assert ours().tolist() == pythons()
    seconds = medians({"ours": ours, "numpy": numpys, "python": pythons}, runs=5)
    rate = len(words) / seconds["ours"] / 1e6
    line(
        f"{name} ({rate:.0f} MB/s) against numpy.fromstring",
        seconds["numpy"] / seconds["ours"],
        ">= 1",
    )
    line(f"{name} against float() of Python", seconds["python"] / seconds["ours"], ">= 2")


def files() -> None:
    """Compare the reading of whole files with reading their numbers alone."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-500, 500, (POINTS, 3)).astype(np.float32)
    faces = rng.integers(0, POINTS, (2 * POINTS, 3))
    rows = ",\n".join(" ".join(map(str, row)) for row in points)
    corners = " -1\n".join(" ".join(map(str, row)) for row in faces.tolist())
    heights = " ".join(map(str, points.ravel()))
    texts = {
        "IndexedFaceSet": "Shape { geometry IndexedFaceSet { coord Coordinate { point [\n"
        f"{rows} ] }}\ncoordIndex [\n{corners} -1 ] }} }}",
        "ElevationGrid": f"Shape {{ geometry ElevationGrid {{ xDimension 1000 zDimension "
        f"{points.size // 1000} height [\n{heights} ] }} }}",
    }
    with tempfile.TemporaryDirectory() as folder:
        for name, text in texts.items():
            path = Path(folder, f"{name}.wrl")
            path.write_text("#VRML V2.0 utf8\n" + text)
            plain = "".join(c if c in "0123456789.-+e" else " " for c in text.split("[", 1)[1])
            plain = plain.replace(" e ", " ")
            words = [word for word in plain.split() if word[-1].isdigit()]
            plain = " ".join(words)
            seconds = medians(
                {
                    "ours": lambda path=path: read_vrml(path),
                    "python": lambda plain=plain: [float(word) for word in plain.split()],
                },
                runs=3,
            )
            rate = path.stat().st_size / seconds["ours"] / 1e6
            line(
                f"a file with an {name} ({rate:.0f} MB/s) against float() of its numbers",
                seconds["python"] / seconds["ours"],
                ">= 1",
            )


def main() -> None:
    rng = np.random.default_rng(0)
    values = rng.uniform(-1000, 1000, (POINTS, 3))
    numbers("float32", ",\n".join(" ".join(map(str, row)) for row in values.astype(np.float32)))
    numbers("17 digits", ",\n".join(" ".join(map(repr, row)) for row in values.tolist()))
    indices = rng.integers(0, POINTS, (POINTS, 3)).tolist()
    numbers("indices", " -1\n".join(" ".join(map(str, row)) for row in indices))
    files()


if __name__ == "__main__":
    main()
