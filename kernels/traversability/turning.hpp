// Turning on the spot, on level ground: what resists it, and what it asks of wheels and motors.
//
// The wheels of each side run at one speed, ahead on the one and back on the other, and skid. What
// holds a wheel acts against the direction in which its contact slides, along and sideways
// together, and is mobilised by how far it slides (Wong and Chiang, "A general theory for skid
// steering of tracked vehicles on firm ground", 2001; Yu, Chuy, Collins and Hollis, "Dynamic
// modeling of a skid-steered wheeled vehicle with experimental verification", 2009, for wheels). So
// along and sideways they share one circle of friction. The vehicle turns about the point at which
// what acts sideways is in balance.
#pragma once

#include "vehicle.hpp"

namespace terratool::traversability {

// Turning by a radian. Where `reason` is not NONE it cannot, and the rest is as far as it gets.
struct Turn {
    double resistance;  // N m
    double skidding;    // the part of it that acts sideways
    double work;        // of the wheels, J
    double run;         // of the outermost treads, m
    double slip;        // of these
    double torque;      // the largest of a wheel, N m
    u8 reason;          // `Reason`
};

template <class Visit> void visit_members(Turn& t, Visit visit) {
    visit("resistance", t.resistance), visit("skidding", t.skidding), visit("work", t.work);
    visit("run", t.run), visit("slip", t.slip), visit("torque", t.torque);
    visit("reason", t.reason);
}

// A wheel of a vehicle that turns at 1 rad/s: speeds are m/s, and m for each radian.
struct TurningWheel {
    double x, y;      // ahead of the centre of gravity, and beside the middle, m
    double strength;  // S = C + W μ, N
    double rolling;   // R, N
    double most;      // that its motor lets it push with, N; 0 where it does not push
    double reach, arm;
    bool flat;  // a section of a track

    struct Forces {
        double along, across, slipping;  // N, and by how much its tread is faster than the ground
    };

    // What holds it if its tread is faster than the ground by `slipping`, and the ground passes
    // sideways at `skidding`.
    Forces forces(double slipping, double skidding) const {
        if (most == 0.0) slipping = 0.0;
        double sliding = hypot(slipping, skidding), tread = y + slipping;
        if (sliding == 0.0) return {0.0, 0.0, slipping};
        double share =
            tread > 0.0 && reach > 0.0 ? Contact::mobilised(reach * sliding / tread, flat) : 1.0;
        double each = strength * share / sliding;
        return {each * slipping, each * skidding, slipping};
    }

    // Likewise; a wheel at its motor's limit is slower than the others of its side.
    Forces limited(double slipping, double skidding) const {
        Forces found = forces(slipping, skidding);
        if (found.along <= most) return found;
        double low = 0.0, high = slipping;
        for (int n = 0; n < 60; ++n) {
            double middle = 0.5 * (low + high);
            (forces(middle, skidding).along <= most ? low : high) = middle;
        }
        return forces(low, skidding);
    }
};

// The wheels of a vehicle that turns.
class Turning {
public:
    explicit Turning(std::vector<TurningWheel> wheels) : wheels_(std::move(wheels)) {
        for (const TurningWheel& w : wheels_) {
            half_ = max(half_, w.y), front_ = max(front_, w.x), rear_ = min(rear_, w.x);
            rolling_ += w.rolling * w.y, slight_ += 1e-12 * w.strength;
        }
    }

    // What is left of the moment that wheels push with at a slip of their treads, N m.
    double surplus(double slip) const {
        double slipping = faster(slip), centre = centre_at(slipping), total = -rolling_;
        for (const TurningWheel& w : wheels_) {
            auto [along, across, _] = w.limited(slipping, abs(w.x - centre));
            total += along * w.y - across * abs(w.x - centre);
        }
        return total;
    }

    // Turning at a slip of the treads.
    Turn at(double slip, Reason reason) const {
        double slipping = faster(slip), centre = centre_at(slipping);
        Turn turn{rolling_, 0.0, 0.0, half_ + slipping, slip, 0.0, u8(reason)};
        double pushed = 0.0;
        for (const TurningWheel& w : wheels_) {
            auto found = w.limited(slipping, abs(w.x - centre));
            turn.skidding += found.across * abs(w.x - centre);
            turn.work += found.along * (w.y + found.slipping);
            pushed += found.along * w.y;
            turn.torque = max(turn.torque, found.along * w.arm);
        }
        turn.resistance += turn.skidding;
        // without K wheels hold before they slide: then they push with what is needed
        double share = pushed > turn.resistance ? turn.resistance / pushed : 1.0;
        turn.work *= share, turn.torque *= share;
        return turn;
    }

    // Whether a wheel is at its motor's limit.
    bool is_weak(double slip) const {
        double slipping = faster(slip), centre = centre_at(slipping);
        for (const TurningWheel& w : wheels_)
            if (w.most > 0.0 && w.forces(slipping, abs(w.x - centre)).along > w.most) return true;
        return false;
    }

private:
    std::vector<TurningWheel> wheels_;
    double half_ = 0.0, front_ = -INF, rear_ = INF, rolling_ = 0.0, slight_ = 0.0;

    double faster(double slip) const { return half_ * slip / (1.0 - slip); }

    // Where what acts sideways is in balance, m ahead of the centre of gravity: where it is so
    // anywhere between two places, as without K between two axles, in the middle.
    double centre_at(double slipping) const {
        return 0.5 * (place_with(slipping, slight_) + place_with(slipping, -slight_));
    }

    // Up to where more than so much acts sideways ahead than behind, N.
    double place_with(double slipping, double more) const {
        double low = rear_, high = front_;
        for (int n = 0; n < 60 && low < high; ++n) {
            double centre = 0.5 * (low + high), total = 0.0;
            for (const TurningWheel& w : wheels_) {
                double across = w.limited(slipping, abs(w.x - centre)).across;
                total += w.x > centre ? across : -across;
            }
            (total > more ? low : high) = centre;
        }
        return 0.5 * (low + high);
    }
};

// Turn a vehicle whose wheels are at `x` and `y` on the level of one soil. `slip` is the largest
// that treads may have. A wheel that is not driven, or stands in the middle, does not push.
inline Turn turn_on_spot(
    const Layout& layout, In x, In y, double weight, const Soils& soil, double slip
) {
    constexpr double all = 1.0 - 1e-9;  // beyond, nothing acts sideways any more
    constexpr int halvings = 60;
    auto wheels = wheels_on(layout, soil);
    // none runs in the track of another
    load_wheels(wheels, layout, weight, {0.0, 0.0, 1.0});
    for (LoadedWheel& f : wheels) f.ahead = -1;
    sink_wheels(wheels);
    auto turning = [&](bool motors) {
        return Turning(each(wheels.size(), [&](std::size_t n) {
            const LoadedWheel& f = wheels[n];
            double beside = abs(y[n]), most = motors ? f.wheel.max_torque / f.contact.arm : INF;
            return TurningWheel{
                x[n],
                beside,
                f.contact.grip,
                towed(f.load, f.contact),
                f.driven && beside > 0.0 ? most : 0.0,
                f.contact.reach,
                f.contact.arm,
                f.contact.flat
            };
        }));
    };
    Turning limited = turning(true);
    double most = min(slip, all);
    if (deepest_share(wheels) >= 1.0) return limited.at(0.0, Reason::SINKAGE);
    if (limited.surplus(most) < 0.0) {
        bool weak = limited.is_weak(most) && turning(false).surplus(most) >= 0.0;
        bool slips = most < all && limited.surplus(all) >= 0.0;
        return limited.at(most, weak ? Reason::TORQUE : slips ? Reason::SLIP : Reason::TRACTION);
    }
    double low = 0.0, high = most;
    if (limited.surplus(0.0) >= 0.0) high = 0.0;
    for (int n = 0; n < halvings && low < high; ++n) {
        double middle = 0.5 * (low + high);
        (limited.surplus(middle) < 0.0 ? low : high) = middle;
    }
    return limited.at(high, Reason::NONE);
}

}  // namespace terratool::traversability
