// What Python sees of kernels/traversability, but for routes.
#include "../traversability/belts.hpp"
#include "../traversability/layers.hpp"
#include "../traversability/turning.hpp"
#include "../traversability/uneven.hpp"
#include "bind.hpp"
#include "modules.hpp"

namespace terratool::python {

using namespace traversability;

namespace {

// A vehicle whose factors of k are those of so many soils.
const Vehicle& with_factors_of(const Vehicle& vehicle, i64 soils, const char* what) {
    IndexCheck{what}(vehicle.factors.rows() == 0 || vehicle.factors.rows() == soils, "factors");
    return vehicle;
}

// A vehicle on the soils of a terrain, whose arrays are kept.
class KeptVehicle {
public:
    KeptVehicle(nb::handle vehicle, nb::handle soils, nb::handle steps)
        : vehicle_(vehicle, where("vehicle")), soils_(soils, where("soils")),
          steps_(steps, where("steps[n]")),
          on(with_factors_of(vehicle_.get(), soils_.get().size(), "VehicleOnSoils"), soils_.get(),
             steps_.get()) {}

private:
    Sizes sizes_;
    Bundled<Vehicle> vehicle_;
    Bundled<Soils> soils_;
    Argument<In> steps_;

    Where where(const char* name) { return {"VehicleOnSoils", name, sizes_}; }

public:
    VehicleOnSoils on;
};

// A vehicle on samples of the soils of a terrain, whose arrays are kept.
class KeptSamples {
public:
    KeptSamples(nb::handle vehicle, nb::handle soils)
        : vehicle_(vehicle, where("vehicle")), soils_(soils, where("soils")),
          on(with_factors_of(vehicle_.get(), soils_.get().steps.columns(), "VehicleOnSamples"),
             soils_.get()) {}

private:
    Sizes sizes_;
    Bundled<Vehicle> vehicle_;
    Bundled<SoilSamples> soils_;

    Where where(const char* name) { return {"VehicleOnSamples", name, sizes_}; }

public:
    VehicleOnSamples on;
};

Drive drive(
    const Layout& layout, double weight, double pitch, const Soils& soil, double pull, Out sinkage
) {
    auto wheels = wheels_on(layout, soil);
    load_wheels(wheels, layout, weight, gravity(tan(pitch), 0.0));
    Drive found = drive_wheels(wheels, pull);
    for (std::size_t n = 0; n < sinkage.size(); ++n) sinkage[n] = depth_of(wheels, i64(n));
    return found;
}

// What single wheels need to push, and at which slip.
void demands(In load, const Soils& soils, In pull, const Wheel& wheel, Span<Demand> out) {
    for (std::size_t n = 0; n < load.size(); ++n) {
        std::array<LoadedWheel, 1> one{{{true, -1, wheel, soils[n], 1.0}}};
        one[0].load = load[n];
        one[0].wheel.max_torque = INF;
        Drive need = drive_wheels(one, pull[n]);
        double torque = need.power > 0.0 ? need.torque : 0.0 - need.torque;  // a brake
        out[n] = {torque, need.utilisation, need.slip, one[0].sinkage};
    }
}

// The shares of a foothold's limits, whatever type surfaces have.
void rate_footholds_of(
    Heights heights,
    const std::variant<Matrix<const u8>, Matrix<const u16>, Matrix<const u32>>& ids,
    const FootholdLimits& limits, Matrix<float> out
) {
    std::visit([&](auto surfaces) { rate_footholds(heights, surfaces, limits, out); }, ids);
}

// Samples are marked in as many words as there are.
void mark_samples(
    const VehicleOnSamples& on, const Stance& stance, double east, double north,
    Matrix<const u8> verdict, Cube<u64> go
) {
    constexpr IndexCheck check_index{"judge_samples"};
    check_index(go.columns() == on.words, "the number of words");
    judge_samples(on, stance, east, north, verdict, go);
}

void mark_uneven(
    const VehicleOnSoils& plain, const VehicleOnSamples& on, const Stance& stance, double east,
    double north, Matrix<const double> errors, Matrix<const i64> shift, Cube<u64> go
) {
    constexpr IndexCheck check_index{"judge_uneven"};
    check_index(go.columns() == on.words, "the number of words");
    check_index(errors.rows() > 0, "the number of errors");
    check_index(i64(plain.soils.size()) == on.ids, "the number of soils");
    for (i64 one : shift.flat()) check_index(one >= 0, "a shift");
    judge_uneven(plain, on, stance, east, north, errors, shift, go);
}

}  // namespace

template <> struct Argument<VehicleOnSoils> : KnownArgument<KeptVehicle> {
    using KnownArgument::KnownArgument;
    VehicleOnSoils& get() { return kept->on; }
};

template <> struct Argument<VehicleOnSamples> : KnownArgument<KeptSamples> {
    using KnownArgument::KnownArgument;
    VehicleOnSamples& get() { return kept->on; }
};

void bind_traversability(nb::module_ m) {
    visit_enumerators(Plane{}, [&](const char* name, Plane plane) { m.attr(name) = int(plane); });
    m.attr("FULL_LUG") = FULL_LUG, m.attr("REACH") = REACH;
    m.attr("RIM_FRICTION") = RIM_FRICTION, m.attr("GROWTH") = GROWTH;
    m.attr("MOST_GRIP") = MOST_GRIP;
    m.def(
        "check_records",
        [](nb::handle traction, nb::handle demand) {
            check_record<Traction>(traction);
            check_record<Demand>(demand);
        },
        "traction"_a, "demand"_a,
        nb::sig("def check_records(traction: np.dtype[Any], demand: np.dtype[Any]) -> None"),
        "Refuse dtypes that are not the structs of the kernels."
    );
    m.def(
        "check_enumerations",
        [](nb::handle verdict, nb::handle reason) {
            check_enumeration<Verdict>(verdict);
            check_enumeration<Reason>(reason);
        },
        "verdict"_a, "reason"_a, "Refuse enumerations that are not those of the kernels."
    );
    nb::class_<KeptVehicle>(
        m, "VehicleOnSoils", "A vehicle on the soils of a terrain, and its tables."
    )
        .def(nb::init<nb::handle, nb::handle, nb::handle>(), "vehicle"_a, "soils"_a, "steps"_a);

    nb::class_<KeptSamples>(
        m, "VehicleOnSamples", "A vehicle on samples of the soils of a terrain, and its tables."
    )
        .def(nb::init<nb::handle, nb::handle>(), "vehicle"_a, "soils"_a);

    def<&contacts>(
        m, "contacts", "Sinkage, entry angle, effective area and shear length.",
        {"load[n]", "sinkage[n]", "slip[n]", "wheel"}
    );
    def<&bearing_factors>(
        m, "bearing_factors", "Bearing capacity factors of cohesion.", {"tan_friction[n]"}
    );
    def<&mean_shares>(
        m, "mean_shares", "Shares of strength mobilised along tracks.", {"displacement[n]"}
    );
    def<&tractions>(
        m, "tractions", "What driven wheels can do at a slip.",
        {"load[n]", "soils", "slip[n]", "max_torque[n]", "wheel", "out[n]"}
    );
    def<&demands>(
        m, "demands", "What wheels need to push.",
        {"load[n]", "soils", "pull[n]", "wheel", "out[n]"}
    );
    def<&towing>(
        m, "towing", "Resistance of wheels without torque.", {"load[n]", "soils", "wheel"}
    );
    def<&grips>(
        m, "grips", "What holds wheels at a slip.", {"load[n]", "soils", "slip[n]", "wheel"}
    );
    def<&side_forces>(
        m, "side_forces", "Forces sideways at a slip and a crab angle.",
        {"load[n]", "soils", "slip[n]", "crab[n]", "wheel"}
    );
    def<&softnesses>(
        m, "softnesses", "0 on rigid ground, 1 on soft soil.", {"load[n]", "sinkage[n]", "wheel"}
    );
    def<&measured_forces>(
        m, "measured_forces", "Load, torque and drawbar pull.",
        {"normal[n]", "shear[n]", "entry[n]", "wheel"}
    );
    def<&measured_stresses>(
        m, "measured_stresses", "Normal and shear stress.",
        {"load[n]", "torque[n]", "entry[n]", "wheel"}
    );

    def<&wheel_loads>(
        m, "wheel_loads", "Loads of a vehicle's wheels on a slope.",
        {"layout", "weight", "pitch", "roll"}
    );
    def<&drive>(
        m, "drive", "What it asks of a vehicle's wheels to push on a slope.",
        {"layout", "weight", "pitch", "soil", "pull", "sinkage[w]"}
    );
    def<&steepest>(
        m, "steepest", "The largest slope on a soil, and the reason that limits it.",
        {"across", "layout", "weight", "soil", "slip"}
    );
    def<&crab_across>(
        m, "crab_across", "The crab angle of a vehicle that drives across a slope.",
        {"layout", "weight", "soil", "angle"}
    );
    def<&braking>(
        m, "braking", "What brakes a vehicle on the level, as a share of its weight.",
        {"layout", "weight", "soil"}
    );
    def<&turn_on_spot>(
        m, "turn_on_spot", "What it takes a vehicle to turn on the spot by a radian.",
        {"layout", "x[w]", "y[w]", "weight", "soil", "slip"}
    );
    def<&judge>(
        m, "judge", "Verdict, reason and largest share of measures.",
        {"shares[m]", "go[m]", "strict[m]", "reasons[m]"}
    );

    def<&judge_cells>(
        m, "judge_cells", "Judge a vehicle with a heading at every reference point.",
        {"vehicle", "stance", "east", "north", "out"}
    );
    def<&mark_samples>(
        m, "judge_samples", "Mark the samples on which a vehicle with a heading goes, as bits.",
        {"vehicle", "stance", "east", "north", "verdict[h,w]", "go[h,w,k]"}
    );
    def<&mark_uneven>(
        m, "judge_uneven",
        "Mark the samples of soils and of errors of heights on which a vehicle goes, as bits.",
        {"vehicle", "sampled", "stance", "east", "north", "errors[_,6]", "shift[h,w]", "go[h,w,k]"}
    );
    def<&count_samples>(
        m, "count_samples", "How many samples are marked at each place.", {"go[h,w,_]", "out[h,w]"}
    );
    def<&highest>(
        m, "highest", "The highest ground under offsets.",
        {"ground[_,_,_]", "first", "offsets[k,3]", "out[_,_]"}
    );
    def<&supports>(
        m, "supports", "How high a wheel stands at every pixel.",
        {"heights[h,w]", "tread[k,2]", "lift[k]", "out[h,w]"}
    );
    def<&raise_supports>(
        m, "raise_supports", "Raise supports where wheels meet crests.",
        {"crests", "tread[k,2]", "shifts[k,2]", "wheel", "out[h,w]"}
    );
    def<&stand>(
        m, "stand", "The plane through the supports of the wheels.",
        {"supports[_,p,c]", "ground[r,p,c]", "first", "standing", "out[3,_,_]"}
    );
    def<&mean>(
        m, "mean", "The mean over offsets.", {"ground[_,_,_]", "first", "offsets[k,3]", "out[_,_]"}
    );
    def<&bumps>(
        m, "bumps", "How far the ground under offsets stands above its plane at most.",
        {"ground[_,_,_]", "first", "offsets[k,3]", "shifts[k,2]", "plane[3,h,w]", "out[h,w]"}
    );
    def<&raise_bumps>(
        m, "raise_bumps", "Raise bumps to what of crests within a body stands above its plane.",
        {"crests", "phases", "first", "offsets[k,2]", "shifts[k,2]", "plane[3,h,w]", "body",
         "out[h,w]"}
    );
    def<&roughness>(
        m, "roughness", "RMS distance of the ground at offsets from its plane.",
        {"ground[_,_,_]", "first", "offsets[k,3]", "shifts[k,2]", "plane[3,h,w]", "spread[3]",
         "out[h,w]"}
    );
    def<&rest_belts>(
        m, "rest_belts", "The plane that two rigid belts rest on.",
        {"ground[_,p,c]", "first", "belts", "out[3,_,_]"}
    );
    def<&rate_footholds_of>(
        m, "rate_footholds", "The largest share of a foothold's limits that a foot takes.",
        {"heights[h,w]", "surfaces[h,w]", "limits", "out[h,w]"}
    );
    def<&choose_footholds>(
        m, "choose_footholds", "The best foothold within reach of every pixel.",
        {"heights[h,w]", "shares[h,w]", "foot", "height[h,w]", "share[h,w]"}
    );
    def<&departures>(
        m, "departures", "How far ground at offsets is from its plane at most.",
        {"ground[_,_,_]", "first", "offsets[k,3]", "shifts[k,2]", "plane[3,h,w]", "out[h,w]"}
    );
    def<&find_layer>(
        m, "find_layer", "What a layer of driving shows at every pixel.",
        {"solids", "sheet", "apart", "rise", "reach", "out"}
    );
    def<&raise_steps>(
        m, "raise_steps", "Mark pixels beside walls with the step that a wheel meets.",
        {"supports[h,w]", "pairs[n]", "jumps[n]", "gaps", "east", "north", "strides", "out[h,w]"}
    );
}

}  // namespace terratool::python
