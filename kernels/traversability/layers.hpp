// Layers of driving: of the tops that stand over each other those on which a vehicle drives about.
//
// A layer has the tops of one sheet, no two of them at a pixel. Beside these it shows what a
// vehicle that stands on them has before it: the highest solid whose bottom is not above what it
// steps up, be it ground to drive on to, ground below an edge, or a wall.
#pragma once

#include "../core.hpp"

namespace terratool::traversability {

// What is solid at pixels, from below; NaN and -1 where there are fewer.
struct Solids {
    Cube<const float> bottom, top;
    Cube<const i32> sheet;  // that the top belongs to
};

template <class Visit> void visit_arguments(Solids& s, Visit visit) {
    visit("bottom[m,h,w]", s.bottom), visit("top[m,h,w]", s.top), visit("sheet[m,h,w]", s.sheet);
}

// What a layer shows at pixels.
struct ShownGround {
    Matrix<i32> solid;    // number of the solid, -1 for none
    Matrix<bool> joined;  // whether it can be driven to from tops of the layer, step by step
    Matrix<bool> own;     // whether it is a top of the layer
};

template <class Visit> void visit_arguments(ShownGround& s, Visit visit) {
    visit("solid[h,w]", s.solid), visit("joined[h,w]", s.joined), visit("own[h,w]", s.own);
}

// A layer of tops of a sheet. Where one of two side by side is not what a vehicle on the other one
// has before it, as at the end of a bridge over a bed with upright banks, the upper one and what it
// leads to within reach lie `apart` in a layer of their own.
class LayerFinder {
public:
    LayerFinder(const Solids& solids, i64 sheet, bool apart, double rise, i64 reach)
        : solids_(solids), rise_(float(rise)), reach_(reach), apart_(apart),
          rows_(solids.top.rows()), columns_(solids.top.columns()), own_(rows_ * columns_, -1) {
        for (i64 k = 0; k < solids.top.layers(); ++k) {
            const i32* sheets = solids.sheet[k].data();
            for (i64 at = 0; at < count_of(own_); ++at)
                if (sheets[at] == sheet) own_[at] = i32(k);
        }
    }

    void find(const ShownGround& out) {
        keep_side();
        i32* shown = out.solid.data();
        bool *joined = out.joined.data(), *own = out.own.data();
        std::vector<i64> here, all;
        level_.assign(own_.size(), 0.0f);
        known_.assign(own_.size(), false);
        for (i64 at = 0; at < count_of(own_); ++at) {
            own[at] = joined[at] = own_[at] >= 0;
            shown[at] = own_[at];
            if (!own[at]) continue;
            known_[at] = true, level_[at] = top(own_[at], at);
            here.push_back(at);
        }
        all = here;
        spread(here, [&](i64 at, i64 next) {
            i32 seen = linked(shown[at], at, next);
            if (seen < 0) return false;
            shown[next] = seen, joined[next] = true, level_[next] = top(seen, next);
            all.push_back(next);
            return true;
        });
        spread(all, [&](i64 at, i64 next) {
            shown[next] = view(level_[at], next);
            level_[next] = shown[next] < 0 ? level_[at] : top(shown[next], next);
            return true;
        });
    }

private:
    Solids solids_;
    float rise_;
    i64 reach_;
    bool apart_;
    i64 rows_, columns_;
    std::vector<i32> own_;
    std::vector<float> level_;
    std::vector<bool> known_;

    float top(i64 solid, i64 at) const { return solids_.top[solid].data()[at]; }

    // What is before a vehicle that stands at a height beside a pixel; -1 for nothing.
    i32 view(float z, i64 at) const {
        i32 found = -1;
        for (i64 k = 0; k < solids_.top.layers(); ++k) {
            if (!(solids_.bottom[k].data()[at] <= z + rise_)) break;
            found = i32(k);
        }
        return found;
    }

    // The solid at a pixel that can be driven to from one beside it, and back; -1 for none.
    i32 linked(i32 solid, i64 at, i64 next) const {
        if (solid < 0) return -1;
        float z = top(solid, at);
        i32 seen = view(z, next);
        if (seen < 0 || abs(top(seen, next) - z) > rise_) return -1;
        return view(top(seen, next), at) == solid ? seen : -1;
    }

    template <class Visit> void visit_beside(i64 at, Visit visit) const {
        i64 row = at / columns_, column = at % columns_;
        if (row > 0) visit(at - columns_);
        if (column > 0) visit(at - 1);
        if (column + 1 < columns_) visit(at + 1);
        if (row + 1 < rows_) visit(at + columns_);
    }

    // Go on from pixels to those beside them that are not known, and from these, up to the reach.
    template <class Visit> void spread(std::vector<i64> here, Visit visit) {
        std::vector<i64> next;
        for (i64 n = 0; n < reach_ && !here.empty(); ++n) {
            for (i64 at : here)
                visit_beside(at, [&](i64 beside) {
                    if (known_[beside] || !visit(at, beside)) return;
                    known_[beside] = true;
                    next.push_back(beside);
                });
            std::swap(here, next);
            next.clear();
        }
    }

    // Whether a top stands above the one beside it, and from one of them something else is seen.
    bool hides(i64 at, i64 beside) const {
        float z = top(own_[at], at), other = top(own_[beside], beside);
        return z > other && (view(z, beside) != own_[beside] || view(other, at) != own_[at]);
    }

    // Keep the tops of one side: the upper ones lie apart.
    void keep_side() {
        std::vector<i64> here;
        known_.assign(own_.size(), false);
        for (i64 at = 0; at < count_of(own_); ++at) {
            if (own_[at] < 0) continue;
            bool parted = false;
            visit_beside(at, [&](i64 beside) {
                parted = parted || (own_[beside] >= 0 && hides(at, beside));
            });
            if (parted) here.push_back(at), known_[at] = true;
        }
        spread(here, [&](i64 at, i64 next) {
            return own_[next] >= 0 && linked(own_[at], at, next) == own_[next];
        });
        for (i64 at = 0; at < count_of(own_); ++at)
            if (known_[at] != apart_) own_[at] = -1;
    }
};

inline void find_layer(
    const Solids& solids, i64 sheet, bool apart, double rise, i64 reach, const ShownGround& out
) {
    LayerFinder(solids, sheet, apart, rise, reach).find(out);
}

}  // namespace terratool::traversability
