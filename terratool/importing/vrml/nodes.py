"""Nodes of VRML97 (ISO/IEC 14772-1), X3D (ISO/IEC 19775-1) and VRML 1.0, with their fields."""

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
        others: names of other nodes, which have no surface and whose fields are not checked.
        statements: words that begin a statement rather than a node.
        is_open: whether further fields may stand in known nodes, which are skipped.
        is_nested: whether nodes lie in each other without a field, and a field may be a plain word.
    """

    name: str
    fields: dict[str, dict[str, str]]
    others: frozenset[str]
    statements: tuple[str, ...]
    is_open: bool = False
    is_nested: bool = False


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


VRML97 = Language(
    "VRML97",
    _FIELDS,
    frozenset(_OTHERS.split()),
    ("PROTO", "EXTERNPROTO", "ROUTE", "IMPORT", "EXPORT"),
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
    BooleanFilter BooleanSequencer BooleanToggle BooleanTrigger ClipPlane ColorDamper ColorRGBA
    ComposedCubeMapTexture ComposedShader ComposedTexture3D CoordinateDamper
    CoordinateInterpolator2D EaseInEaseOut EnvironmentLight FillProperties FloatVertexAttribute
    FogCoordinate GeneratedCubeMapTexture GeoLocation GeoMetadata GeoOrigin GeoViewpoint
    ImageCubeMapTexture ImageTexture3D ImageTextureAtlas IntegerSequencer IntegerTrigger KeySensor
    LineProperties LineSet LoadSensor LocalFog Matrix3VertexAttribute Matrix4VertexAttribute
    MetadataBoolean MetadataDouble MetadataFloat MetadataInteger MetadataSet MetadataString
    MultiTexture MultiTextureCoordinate MultiTextureTransform OrientationChaser OrientationDamper
    OrthoViewpoint PackagedShader PhysicalMaterial PixelTexture3D PointProperties PositionChaser
    PositionChaser2D PositionDamper PositionDamper2D PositionInterpolator2D ProgramShader
    ScalarChaser ScalarDamper ShaderPart ShaderProgram SplinePositionInterpolator
    SplinePositionInterpolator2D SplineScalarInterpolator SquadOrientationInterpolator StringSensor
    TexCoordChaser2D TexCoordDamper2D TextureBackground TextureCoordinate3D TextureCoordinate4D
    TextureCoordinateGenerator TextureProjector TextureProjectorParallel TextureProperties
    TextureTransform3D TextureTransformMatrix3D TimeTrigger TransformSensor TwoSidedMaterial
    UnlitMaterial Viewport ViewpointGroup
"""

X3D = Language(
    "X3D",
    _FIELDS | {kind: _FIELDS.get(kind, {}) | more for kind, more in _MORE.items()},
    VRML97.others | frozenset(_MORE_OTHERS.split()),
    VRML97.statements,
    is_open=True,
)
"""X3D, of whose two hundred nodes only those are listed that say where surfaces are, and those that
may stand among them without a surface of their own."""

_PLACED = "translation SFVec3f, rotation SFRotation, scaleFactor SFVec3f, "
_PLACED += "scaleOrientation SFRotation, center SFVec3f"

_OTHERS_OF_VRML1 = """
    AsciiText DirectionalLight FontStyle IndexedLineSet Info Material MaterialBinding Normal
    NormalBinding OrthographicCamera PerspectiveCamera PointLight PointSet SpotLight Texture2
    Texture2Transform TextureCoordinate2
"""

VRML1 = Language(
    "VRML 1.0",
    _table(
        {
            "Cone": "bottomRadius SFFloat, height SFFloat",
            "Coordinate3": "point MFVec3f",
            "Cube": "width SFFloat, height SFFloat, depth SFFloat",
            "Cylinder": "radius SFFloat, height SFFloat",
            "Group": "",
            "IndexedFaceSet": "coordIndex MFInt32",
            "LOD": "",
            "MatrixTransform": "matrix SFMatrix4f",
            "Rotation": "rotation SFRotation",
            "Scale": "scaleFactor SFVec3f",
            "Separator": "",
            "ShapeHints": "",
            "Sphere": "radius SFFloat",
            "Switch": "whichChild SFInt32",
            "Transform": _PLACED,
            "TransformSeparator": "",
            "Translation": "translation SFVec3f",
            "WWWAnchor": "",
            "WWWInline": "",
        }
    ),
    frozenset(_OTHERS_OF_VRML1.split()),
    (),
    is_open=True,
    is_nested=True,
)
"""VRML 1.0 (the specification of 1995), whose nodes change a state for those that follow."""
