// Go, caution or no-go, and why; terratool/traversability/verdicts.py says what they mean.
#pragma once

#include <tuple>

#include "../core.hpp"

namespace terratool::traversability {

enum class Verdict : u8 { UNKNOWN, GO, CAUTION, NO_GO };

enum class Reason : u8 {
    NONE,
    NO_GROUND,
    EDGE,
    SOIL_UNKNOWN,
    TRACTION,
    TORQUE,
    SLIP,
    SINKAGE,
    SIDE_SLIP,
    TIP_OVER,
    STEP,
    HIGH_CENTRED,
    APPROACH,
    ROUGHNESS,
    TURNING,
    DRIFT,
    FOOTHOLD,
    KEEP_OUT,
    HEADROOM
};

template <class Visit> void visit_enumerators(Verdict, Visit visit) {
    using enum Verdict;
    visit("UNKNOWN", UNKNOWN), visit("GO", GO), visit("CAUTION", CAUTION), visit("NO_GO", NO_GO);
}

template <class Visit> void visit_enumerators(Reason, Visit visit) {
    using enum Reason;
    visit("NONE", NONE), visit("NO_GROUND", NO_GROUND), visit("EDGE", EDGE);
    visit("SOIL_UNKNOWN", SOIL_UNKNOWN), visit("TRACTION", TRACTION), visit("TORQUE", TORQUE);
    visit("SLIP", SLIP), visit("SINKAGE", SINKAGE), visit("SIDE_SLIP", SIDE_SLIP);
    visit("TIP_OVER", TIP_OVER), visit("STEP", STEP), visit("HIGH_CENTRED", HIGH_CENTRED);
    visit("APPROACH", APPROACH), visit("ROUGHNESS", ROUGHNESS);
    visit("TURNING", TURNING), visit("DRIFT", DRIFT), visit("FOOTHOLD", FOOTHOLD);
    visit("KEEP_OUT", KEEP_OUT), visit("HEADROOM", HEADROOM);
}

// What follows from the measures so far.
struct Judgement {
    Verdict verdict;
    Reason reason = Reason::NONE;
    double worst = 0.0;  // the largest share that any takes of its limit

    // One more measure: go up to the share `go` of its limit, caution up to 1 (below 1 if it is
    // `strict`), then no-go. Of measures of one verdict the one that takes the largest share
    // counts.
    INLINE void add(Reason why, double share, double go, bool strict) {
        Verdict found = share > 1.0 || (strict && share >= 1.0) ? Verdict::NO_GO
            : share >= go                                       ? Verdict::CAUTION
                                                                : Verdict::GO;
        if (found > verdict || (found == verdict && share > worst)) reason = why;
        verdict = max(verdict, found);
        worst = max(worst, share);
    }
};

// Verdict, reason and largest share of measures (m,); `reasons` are numbers of `Reason`.
inline std::tuple<i64, i64, double> judge(
    In shares, In go, Span<const bool> strict, Span<const u8> reasons
) {
    Judgement judgement{Verdict::UNKNOWN};
    for (std::size_t m = 0; m < shares.size(); ++m)
        judgement.add(Reason(reasons[m]), shares[m], go[m], strict[m]);
    return {i64(judgement.verdict), i64(judgement.reason), judgement.worst};
}

}  // namespace terratool::traversability
