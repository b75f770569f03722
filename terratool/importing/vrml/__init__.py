"""Reader of VRML97 and X3D."""
