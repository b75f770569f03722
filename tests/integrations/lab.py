"""Isaac Lab's own terrains, of its package, without the simulator that it needs for the rest."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

_STUBS = ("isaaclab.sim", "isaaclab.markers", "isaaclab.markers.config", "isaaclab.utils.math")


class _Anything:
    """Attribute of a module that nobody calls."""

    def __init__(self, *_: object, **__: object) -> None:
        self.device = "cpu"

    @classmethod
    def instance(cls) -> _Anything:
        """The only one, as of a simulation."""
        return cls()


def _attribute(name: str) -> type[_Anything]:
    """Attribute of a module by its name."""
    if name.startswith("__"):
        raise AttributeError(name)
    return _Anything


def isaac_lab_terrains() -> Any:
    """The module `isaaclab.terrains`."""
    found = importlib.util.find_spec("isaaclab")
    assert found is not None and found.submodule_search_locations
    if "isaaclab.terrains" in sys.modules:
        return sys.modules["isaaclab.terrains"]
    source = Path(found.submodule_search_locations[0]) / "source" / "isaaclab" / "isaaclab"
    for name in ("isaaclab", "isaaclab.utils"):
        module = sys.modules[name] = ModuleType(name)
        module.__path__ = [str(source.joinpath(*name.split(".")[1:]))]
    for name in _STUBS:
        stub: Any = ModuleType(name)
        stub.__getattr__ = _attribute
        sys.modules[name] = stub
    utils: Any = sys.modules["isaaclab.utils"]
    utils.configclass = importlib.import_module("isaaclab.utils.configclass").configclass
    utils.class_to_dict = importlib.import_module("isaaclab.utils.dict").class_to_dict
    return importlib.import_module("isaaclab.terrains")
