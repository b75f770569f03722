"""The kernel that judges a vehicle at every reference point of a window, at one heading."""

from __future__ import annotations

import math

import numpy as np

from terratool.traversability.maps import standing
from terratool.traversability.maps.standing import looked_up, share_of, stand
from terratool.traversability.results import Reason, Verdict
from terratool.traversability.terramechanics.kernels import (
    gravity,
    judge,
    kernel,
    tip_reserve,
    tipping,
)

_UNKNOWN, _GO, _NO_GO = int(Verdict.UNKNOWN), int(Verdict.GO), int(Verdict.NO_GO)
_NO_GROUND = int(Reason.NO_GROUND)
_EDGE = int(Reason.EDGE)
_SOIL_UNKNOWN = int(Reason.SOIL_UNKNOWN)
_TRACTION = int(Reason.TRACTION)
_TORQUE = int(Reason.TORQUE)
_SLIP = int(Reason.SLIP)
_SINKAGE = int(Reason.SINKAGE)
_SIDE_SLIP = int(Reason.SIDE_SLIP)
_TIP_OVER = int(Reason.TIP_OVER)
_STEP = int(Reason.STEP)
_HIGH_CENTRED = int(Reason.HIGH_CENTRED)
_APPROACH = int(Reason.APPROACH)
_ROUGHNESS = int(Reason.ROUGHNESS)

UTILISATION, PITCH, ROLL, SINKAGE, SLIP, ENERGY, DRAWBAR, RESERVE = range(8)
"""Planes of numbers that `judge_cells` makes."""
PLANES = 8


@kernel
def judge_cells(
    plane, bump, front, rear, rough, step, under, edge, vehicle, ahead, soils, tables,
    verdict, reason, out,
):  # fmt: skip
    """Judge a vehicle that looks in one direction at every reference point.

    Args:
        plane: (3, height, width) float32: height of the plane through the wheels' supports, NaN
            where one has none, and its slopes to the east and the north.
        bump: (height, width) float32, how far the ground stands above that under the body, m.
        front: likewise under its front overhang.
        rear: likewise under its rear overhang.
        rough: RMS distance of the ground from its plane, m; NaN where it is not known.
        step: highest step ahead of the wheels, m.
        under: (wheels, height, width) surfaces under the wheels, rows of `soils`.
        edge: (height, width) bool, whether the vehicle reaches beyond the terrain.
        vehicle: `vehicles.Numbers`.
        ahead: unit vector of its heading, east and north.
        soils: (surfaces + 1, 5), as `standing.stand` takes them.
        tables: (surfaces + 1, …) `standing.tabulate`, of the soils that are known and are here.
        verdict: (height, width) uint8, result.
        reason: (height, width) uint8, result.
        out: (PLANES, height, width) float32, results.
    """
    v = vehicle
    count = len(v.shares)
    load, half = np.empty(count), np.empty(count)
    wheels, need = np.zeros(count, np.int64), np.empty(standing.NUMBERS)
    shape = v.go_geometry
    height, width = verdict.shape
    for i in range(height):
        for j in range(width):
            for p in range(PLANES):
                out[p, i, j] = np.nan
            if edge[i, j] or np.isnan(plane[0, i, j]):
                verdict[i, j] = _NO_GO
                reason[i, j] = _EDGE if edge[i, j] else _NO_GROUND
                out[UTILISATION, i, j] = out[ENERGY, i, j] = np.inf
                continue
            east, north = np.float64(plane[1, i, j]), np.float64(plane[2, i, j])
            along = east * ahead[0] + north * ahead[1]
            across = north * ahead[0] - east * ahead[1]
            forward, left, down = gravity(along, across)

            known, alike, vague, limit = True, True, False, math.inf
            for n in range(count):
                s = np.int64(under[n, i, j])
                wheels[n] = s
                known = known and not np.isnan(soils[s, 0])
                alike = alike and s == wheels[0]
                vague = vague or (v.driven[n] and soils[s, 2] > 0.0 and soils[s, 3] == 0.0)
                limit = min(limit, soils[s, 4])
            if not known:
                # only what its shape decides can be told
                need[standing.DEEPEST] = 0.0
                need[standing.TIPPING] = tipping(v.edges, forward, left, down)
                need[standing.RESERVE] = tip_reserve(v.edges, forward, left, down)
            elif not (alike and looked_up(v, tables[wheels[0]], along, across, need)):
                stand(v, along, across, soils, wheels, load, half, need)

            worst, found, why = 0.0, _GO, 0
            found, why, worst = judge(
                found, why, worst, need[standing.TIPPING], shape, False, _TIP_OVER
            )
            taken = share_of(np.float64(step[i, j]), limit)
            found, why, worst = judge(found, why, worst, taken, shape, False, _STEP)
            if rough[i, j] > 0.0:
                taken = share_of(np.float64(rough[i, j]), v.roughness)
                found, why, worst = judge(found, why, worst, taken, shape, False, _ROUGHNESS)
            sunk = need[standing.DEEPEST]
            for rise, room, what in (
                (bump[i, j], v.clearance, _HIGH_CENTRED),
                (front[i, j], v.front, _APPROACH),
                (rear[i, j], v.rear, _APPROACH),
            ):
                if room < math.inf:
                    taken = share_of(max(0.0, np.float64(rise)) * down + sunk, room)
                    found, why, worst = judge(found, why, worst, taken, shape, True, what)
            if known:
                traction, torque = need[standing.SHARE], need[standing.TORQUE]
                slip, sliding = need[standing.SLIP], need[standing.SLIDING]
                found, why, worst = judge(
                    found, why, worst, traction, v.go_traction, True, _TRACTION
                )
                taken = slip / v.slip
                found, why, worst = judge(found, why, worst, taken, v.go_slip, True, _SLIP)
                taken = share_of(torque, v.max_torque)
                found, why, worst = judge(found, why, worst, taken, v.go_torque, False, _TORQUE)
                found, why, worst = judge(found, why, worst, sunk / v.radius, shape, True, _SINKAGE)
                found, why, worst = judge(found, why, worst, sliding, shape, False, _SIDE_SLIP)
                out[SINKAGE, i, j], out[SLIP, i, j] = sunk, np.nan if vague else slip
                out[ENERGY, i, j] = need[standing.ENERGY]
                out[DRAWBAR, i, j] = need[standing.DRAWBAR]
            elif found != _NO_GO:
                # whatever the soil is like, the rest can be driven
                found, why, worst = _UNKNOWN, _SOIL_UNKNOWN, math.nan
            verdict[i, j], reason[i, j] = found, why
            out[PITCH, i, j], out[ROLL, i, j] = math.atan(along), math.atan(across)
            out[UTILISATION, i, j], out[RESERVE, i, j] = worst, need[standing.RESERVE]
