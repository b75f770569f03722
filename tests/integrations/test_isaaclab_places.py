"""Level places of the generator for Isaac Lab, which are tensors of PyTorch."""

from __future__ import annotations

import numpy as np
import pytest

from terratool.integrations.isaaclab import TerrainGenerator, TileCfg
from tests.integrations.test_isaaclab import BOX, SIZE, generator_cfg, patches

torch = pytest.importorskip("torch", reason="torch is not installed")


def test_level_places_are_tensors() -> None:
    tiles = {
        "a": TileCfg(BOX, flat_patch_sampling={"root": patches()}),
        "b": TileCfg(BOX, flat_patch_sampling={"root": patches(max_height_diff=0.1)}),
        "c": {"kind": "flat"},
    }
    made = TerrainGenerator(generator_cfg(tiles), device="cpu")
    places = made.flat_patches["root"]
    assert places.dtype == torch.float32 and places.shape == (2, 3, 3, 3)
    # a kind that asks for none has its origin there
    wanted = np.repeat(made.terrain_origins[:, 2:, np.newaxis], 3, axis=2)
    assert places[:, 2:].numpy() == pytest.approx(wanted)
    x, y, z = np.moveaxis(places.numpy().astype(float), -1, 0)
    assert made.terrain.height(x, y) == pytest.approx(z, abs=1e-5)
    across = np.abs(y - np.array([-5.0, 0.0, 5.0])[:, np.newaxis])
    assert (across <= SIZE[1] / 2 - 0.3 + 1e-5)[:, :2].all()
