"""The nodes of VRML97 (ISO/IEC 14772-1, clause 6), what their fields are, and a scene of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

WIDTHS = {
    "Color": 3,
    "Float": 1,
    "Int32": 1,
    "Rotation": 4,
    "Time": 1,
    "Vec2f": 2,
    "Vec3f": 3,
}
"""How many numbers a value has, by its type without SF or MF."""

TYPES = frozenset(
    [f"{many}F{kind}" for many in "SM" for kind in (*WIDTHS, "Node", "String")]
    + ["SFBool", "SFImage"]
)


class FieldValue(NamedTuple):
    """What stands behind the name of a field.

    Attributes:
        kind: "empty" is what [] and NULL are, "field" a name behind IS.
        at: where it begins, in bytes.
    """

    kind: Literal["numbers", "strings", "flag", "nodes", "field", "empty"]
    at: int
    numbers: NDArray[np.float64] = np.empty(0)
    nodes: tuple[Node, ...] = ()
    flag: bool = False
    name: str = ""


@dataclass(slots=True, eq=False)
class Node:
    """A node as the text has it; DEF and USE make it one object in several places.

    Attributes:
        kind: its type, as Transform.
        at: where that stands, in bytes.
        proto: what declares the type, if VRML does not.
    """

    kind: str
    at: int
    proto: Proto | None = None
    fields: dict[str, FieldValue] = field(default_factory=dict)


@dataclass(slots=True, eq=False)
class Proto:
    """A PROTO or an EXTERNPROTO.

    Attributes:
        types: of its fields and events, by their names.
        defaults: values of those that have one.
        body: the first node of its body; None in an empty one.
        external: whether another file has the body.
    """

    name: str
    types: dict[str, str] = field(default_factory=dict)
    defaults: dict[str, FieldValue] = field(default_factory=dict)
    body: Node | None = None
    external: bool = False


FIELDS: dict[str, dict[str, str]] = {
    kind: dict(pair.split() for pair in text.split(", "))
    for kind, text in {
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
    }.items()
}
"""Types of the fields of all nodes that have a part in where surfaces are."""

_OTHERS = """
    Appearance AudioClip Background Color ColorInterpolator CoordinateInterpolator
    CylinderSensor DirectionalLight Fog FontStyle ImageTexture IndexedLineSet Inline Material
    MovieTexture NavigationInfo Normal NormalInterpolator OrientationInterpolator PixelTexture
    PlaneSensor PointLight PointSet PositionInterpolator ProximitySensor ScalarInterpolator
    Script Sound SphereSensor SpotLight Text TextureCoordinate TextureTransform TimeSensor
    TouchSensor Viewpoint VisibilitySensor WorldInfo
"""

OTHERS = frozenset(_OTHERS.split())
"""All other nodes; what fields they have is not looked at."""
