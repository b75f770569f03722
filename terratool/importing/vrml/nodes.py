"""Nodes of VRML97 (ISO/IEC 14772-1) and X3D (ISO/IEC 19775-1), with the types of their fields."""

from __future__ import annotations

from typing import NamedTuple

WIDTHS = {
    "Color": 3,
    "Float": 1,
    "Int32": 1,
    "Rotation": 4,
    "Time": 1,
    "Vec2f": 2,
    "Vec3f": 3,
    # of X3D alone
    "ColorRGBA": 4,
    "Double": 1,
    "Matrix3d": 9,
    "Matrix3f": 9,
    "Matrix4d": 16,
    "Matrix4f": 16,
    "Vec2d": 2,
    "Vec3d": 3,
    "Vec4d": 4,
    "Vec4f": 4,
}
"""Numbers in a value, by its type without SF or MF."""


class Language(NamedTuple):
    """Nodes and statements that a text may have.

    Attributes:
        name: name of the language for people.
        fields: types of fields by node, for all nodes that decide where surfaces are.
        others: names of all other nodes, whose fields are not checked.
        types: types of fields.
        statements: words that begin a statement rather than a node.
        interface: words before a field or an event of a Script; the first two have a value.
        is_open: whether further nodes and fields may stand in a text, which are skipped.
    """

    name: str
    fields: dict[str, dict[str, str]]
    others: frozenset[str]
    types: frozenset[str]
    statements: tuple[str, ...]
    interface: tuple[str, ...]
    is_open: bool


def _table(nodes: dict[str, str]) -> dict[str, dict[str, str]]:
    return {
        kind: dict(pair.split() for pair in text.split(", ")) if text else {}
        for kind, text in nodes.items()
    }


_FIELDS = _table(
    {
        "Anchor": "children MFNode, description SFString, parameter MFString, url MFString, "
        "bboxCenter SFVec3f, bboxSize SFVec3f",
        "Billboard": "children MFNode, axisOfRotation SFVec3f, bboxCenter SFVec3f, "
        "bboxSize SFVec3f",
        "Box": "size SFVec3f",
        "Collision": "children MFNode, collide SFBool, proxy SFNode, bboxCenter SFVec3f, "
        "bboxSize SFVec3f",
        "Cone": "bottomRadius SFFloat, height SFFloat, side SFBool, bottom SFBool",
        "Coordinate": "point MFVec3f",
        "Cylinder": "radius SFFloat, height SFFloat, side SFBool, bottom SFBool, top SFBool",
        "ElevationGrid": "color SFNode, normal SFNode, texCoord SFNode, height MFFloat, "
        "ccw SFBool, colorPerVertex SFBool, creaseAngle SFFloat, normalPerVertex SFBool, "
        "solid SFBool, xDimension SFInt32, xSpacing SFFloat, zDimension SFInt32, zSpacing SFFloat",
        "Extrusion": "beginCap SFBool, ccw SFBool, convex SFBool, creaseAngle SFFloat, "
        "crossSection MFVec2f, endCap SFBool, orientation MFRotation, scale MFVec2f, "
        "solid SFBool, spine MFVec3f",
        "Group": "children MFNode, bboxCenter SFVec3f, bboxSize SFVec3f",
        "IndexedFaceSet": "color SFNode, coord SFNode, normal SFNode, texCoord SFNode, "
        "ccw SFBool, colorIndex MFInt32, colorPerVertex SFBool, convex SFBool, "
        "coordIndex MFInt32, creaseAngle SFFloat, normalIndex MFInt32, normalPerVertex SFBool, "
        "solid SFBool, texCoordIndex MFInt32",
        "LOD": "level MFNode, center SFVec3f, range MFFloat",
        "Shape": "appearance SFNode, geometry SFNode",
        "Sphere": "radius SFFloat",
        "Switch": "choice MFNode, whichChoice SFInt32",
        "Transform": "center SFVec3f, children MFNode, rotation SFRotation, scale SFVec3f, "
        "scaleOrientation SFRotation, translation SFVec3f, bboxCenter SFVec3f, bboxSize SFVec3f",
    }
)

_OTHERS = """
    Appearance AudioClip Background Color ColorInterpolator CoordinateInterpolator
    CylinderSensor DirectionalLight Fog FontStyle ImageTexture IndexedLineSet Inline Material
    MovieTexture NavigationInfo Normal NormalInterpolator OrientationInterpolator PixelTexture
    PlaneSensor PointLight PointSet PositionInterpolator ProximitySensor ScalarInterpolator
    Script Sound SphereSensor SpotLight Text TextureCoordinate TextureTransform TimeSensor
    TouchSensor Viewpoint VisibilitySensor WorldInfo
"""


def _types(kinds: tuple[str, ...]) -> frozenset[str]:
    return frozenset(
        [f"{many}F{kind}" for many in "SM" for kind in (*kinds, "Node", "String")]
        + ["SFBool", "SFImage"]
    )


VRML97 = Language(
    "VRML97",
    _FIELDS,
    frozenset(_OTHERS.split()),
    _types(tuple(WIDTHS)[:7]),
    ("PROTO", "EXTERNPROTO", "ROUTE"),
    ("field", "exposedField", "eventIn", "eventOut"),
    is_open=False,
)

_SET = "coord SFNode, color SFNode, normal SFNode, texCoord SFNode, ccw SFBool, "
_SET += "colorPerVertex SFBool, normalPerVertex SFBool, solid SFBool"
_MORE = _table(
    {
        "Box": "solid SFBool",
        "CADAssembly": "children MFNode",
        "CADFace": "shape SFNode",
        "CADLayer": "children MFNode",
        "CADPart": "center SFVec3f, children MFNode, rotation SFRotation, scale SFVec3f, "
        "scaleOrientation SFRotation, translation SFVec3f",
        "Cone": "solid SFBool",
        "CoordinateDouble": "point MFVec3d",
        "Cylinder": "solid SFBool",
        "IndexedQuadSet": f"{_SET}, index MFInt32",
        "IndexedTriangleFanSet": f"{_SET}, index MFInt32",
        "IndexedTriangleSet": f"{_SET}, index MFInt32",
        "IndexedTriangleStripSet": f"{_SET}, index MFInt32",
        "LOD": "children MFNode",
        "QuadSet": _SET,
        "Sphere": "solid SFBool",
        "StaticGroup": "children MFNode",
        "Switch": "children MFNode",
        "TriangleFanSet": f"{_SET}, fanCount MFInt32",
        "TriangleSet": _SET,
        "TriangleStripSet": f"{_SET}, stripCount MFInt32",
    }
)

_MORE_OTHERS = """
    ClipPlane ColorRGBA EnvironmentLight GeoLocation GeoMetadata GeoOrigin GeoViewpoint
    KeySensor LocalFog MetadataBoolean MetadataDouble MetadataFloat MetadataInteger MetadataSet
    MetadataString MultiTexture OrthoViewpoint PhysicalMaterial StringSensor TextureBackground
    TextureProperties UnlitMaterial
"""

X3D = Language(
    "X3D",
    _FIELDS | {kind: _FIELDS.get(kind, {}) | more for kind, more in _MORE.items()},
    VRML97.others | frozenset(_MORE_OTHERS.split()),
    _types(tuple(WIDTHS)),
    ("PROTO", "EXTERNPROTO", "ROUTE", "IMPORT", "EXPORT"),
    ("initializeOnly", "inputOutput", "inputOnly", "outputOnly", *VRML97.interface),
    is_open=True,
)
"""X3D, of whose two hundred nodes only those are listed that say where surfaces are, and those that
may stand among them without a surface of their own."""
