// What bodies do on a terrain in Gazebo's physics: as its Physics system does, meshes and height
// maps are attached one by one, each file as a whole, and the rest comes from the SDF.
//
//   drop WORLD.sdf SECONDS < bodies      bodies: "drop x y z radius", "wheel x y z radius" or
//                                        "slide x y z slope"
//
// For a sphere, or a wheel that would roll to the north, it prints where its lowest point is in the
// end, moving along z alone; for a box on a slope that rises to the east, how far it slid.
#include <cmath>
#include <filesystem>
#include <iostream>
#include <sstream>
#include <vector>

#include <ignition/common/Console.hh>
#include <ignition/common/ImageHeightmap.hh>
#include <ignition/common/MeshManager.hh>
#include <ignition/math/eigen3/Conversions.hh>
#include <ignition/physics/ForwardStep.hh>
#include <ignition/physics/FrameSemantics.hh>
#include <ignition/physics/GetEntities.hh>
#include <ignition/physics/RequestEngine.hh>
#include <ignition/physics/dartsim/World.hh>
#include <ignition/physics/heightmap/HeightmapShape.hh>
#include <ignition/physics/mesh/MeshShape.hh>
#include <ignition/physics/sdf/ConstructCollision.hh>
#include <ignition/physics/sdf/ConstructLink.hh>
#include <ignition/physics/sdf/ConstructModel.hh>
#include <ignition/physics/sdf/ConstructWorld.hh>
#include <ignition/plugin/Loader.hh>
#include <sdf/Collision.hh>
#include <sdf/Geometry.hh>
#include <sdf/Heightmap.hh>
#include <sdf/Link.hh>
#include <sdf/Mesh.hh>
#include <sdf/Model.hh>
#include <sdf/Root.hh>
#include <sdf/World.hh>

namespace physics = ignition::physics;

struct Features : physics::FeatureList<
                      physics::ForwardStep, physics::LinkFrameSemantics, physics::GetEntities,
                      physics::GetLinkFromModel, physics::heightmap::AttachHeightmapShapeFeature,
                      physics::mesh::AttachMeshShapeFeature, physics::sdf::ConstructSdfModel,
                      physics::sdf::ConstructSdfWorld> {};

static std::string body(
    int number, double x, double y, double z, double angle, const std::string& kind, double radius
) {
    std::ostringstream text;
    const std::string round = "<radius>" + std::to_string(radius) + "</radius>";
    const std::string shape = kind == "drop" ? "<sphere>" + round + "</sphere>"
        : kind == "wheel" ? "<cylinder>" + round + "<length>0.08</length></cylinder>"
                          : "<box><size>0.4 0.4 0.1</size></box>";
    const std::string turned = kind == "wheel" ? "<pose>0 0 0 0 1.5707963267948966 0</pose>" : "";
    text.precision(12);
    text << "<sdf version='1.7'><model name='body" << number << "'><pose>" << x << " " << y << " "
         << z << " 0 " << -angle << " 0</pose><link name='link'><inertial><mass>1</mass><inertia>"
         << "<ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia></inertial>"
         << "<collision name='shape'>" << turned << "<geometry>" << shape
         << "</geometry><surface><friction><ode>"
         << "<mu>10</mu><mu2>10</mu2></ode></friction></surface></collision></link>";
    if (kind != "slide")
        text << "<joint name='slider' type='prismatic'><parent>world</parent><child>link</child>"
             << "<axis><xyz>0 0 1</xyz></axis></joint>";
    text << "</model></sdf>";
    return text.str();
}

int main(int, char** argv) {
    ignition::common::Console::SetVerbosity(0);
    ignition::plugin::Loader loader;
    loader.LoadLib(PLUGIN);
    auto plugin = loader.Instantiate("ignition::physics::dartsim::Plugin");
    auto engine = physics::RequestEngine3d<Features>::From(plugin);

    sdf::Root root;
    for (const auto& error : root.Load(argv[1])) std::cerr << error << "\n";
    const sdf::World* given = root.WorldByIndex(0);
    auto world = engine->ConstructWorld(*given);
    const auto folder = std::filesystem::path(argv[1]).parent_path();
    const sdf::Model* model = given->ModelByIndex(0);
    auto terrain = world->GetModel(model->Name());
    const sdf::Link* link = model->LinkByIndex(0);
    auto ground = terrain->GetLink(link->Name());
    for (std::size_t i = 0; i < link->CollisionCount(); ++i) {
        const sdf::Collision* one = link->CollisionByIndex(i);
        const auto pose = ignition::math::eigen3::convert(one->RawPose());
        if (const sdf::Heightmap* shape = one->Geom()->HeightmapShape()) {
            ignition::common::ImageHeightmap heights;
            heights.Load((folder / shape->Uri()).string());
            const auto size = ignition::math::eigen3::convert(shape->Size());
            ground->AttachHeightmapShape(one->Name(), heights, pose, size, shape->Sampling());
            continue;
        }
        const sdf::Mesh* shape = one->Geom()->MeshShape();
        if (!shape) continue;  // a box or a cylinder, which the model has already
        const auto* mesh =
            ignition::common::MeshManager::Instance()->Load((folder / shape->Uri()).string());
        ground->AttachMeshShape(one->Name(), *mesh, pose);
    }

    struct Body {
        bool rests;
        double x, y, z, radius;
        physics::Link3dPtr<Features> link;
    };
    std::vector<Body> bodies;
    std::string kind;
    double x, y, z, size;
    while (std::cin >> kind >> x >> y >> z >> size) {
        const bool rests = kind != "slide";
        const double angle = rests ? 0.0 : std::atan(size);
        const double above = rests ? size + 0.02 : 0.051;
        Body one{rests, x - above * std::sin(angle), y, z + above * std::cos(angle), size, {}};
        sdf::Root own;
        own.LoadSdfString(body(bodies.size(), one.x, one.y, one.z, angle, kind, size));
        one.link = world->ConstructModel(*own.Model())->GetLink("link");
        bodies.push_back(one);
    }

    physics::ForwardStep::Output output;
    physics::ForwardStep::State state;
    physics::ForwardStep::Input input;
    for (int step = 0; step < std::stod(argv[2]) * 1000; ++step) world->Step(output, state, input);
    std::cout.precision(12);
    for (const Body& one : bodies) {
        const auto at = one.link->FrameDataRelativeToWorld().pose.translation();
        if (one.rests) std::cout << "rest " << at.z() - one.radius << "\n";
        else
            std::cout << "slid "
                      << std::hypot(at.x() - one.x, std::hypot(at.y() - one.y, at.z() - one.z))
                      << "\n";
    }
}
