"""Search for structures in a DEM: boxes, ramps, ridges, hills and craters."""
