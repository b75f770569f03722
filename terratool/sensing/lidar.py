"""Rays of a lidar, column by column of beams."""

from __future__ import annotations

import numpy as np

from terratool.sensing.readings import Rays
from terratool.sensing.sensor import Lidar


def lidar_rays(lidar: Lidar) -> Rays:
    """Rays of one turn, column by column, each column in the order of its beams.

    A beam of elevation e in a column of azimuth a has direction
    (cos e · cos a, cos e · sin a, sin e).
    """
    elevations, azimuths = np.array(lidar.elevations), lidar.azimuths
    columns, beams = lidar.columns, len(elevations)
    level = np.cos(elevations)
    directions = np.empty((columns, beams, 3))
    directions[..., 0] = np.cos(azimuths)[:, None] * level
    directions[..., 1] = np.sin(azimuths)[:, None] * level
    directions[..., 2] = np.sin(elevations)
    fired = np.arange(beams) * lidar.firing_interval
    return Rays(
        directions=directions.reshape(-1, 3),
        columns=np.repeat(np.arange(columns), beams),
        ring=np.tile(np.arange(beams, dtype=np.uint16), columns),
        offset=(lidar.times[:, None] + fired).ravel(),
        along=np.ones(columns * beams),
    )
