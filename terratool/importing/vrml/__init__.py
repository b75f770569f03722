"""VRML97 (ISO/IEC 14772-1) becomes triangles."""
