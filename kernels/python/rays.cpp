// What Python sees of kernels/field/rays.hpp.
#include "../field/rays.hpp"

#include "field.hpp"
#include "modules.hpp"

#include <memory>

namespace terratool::python {

namespace {

// The index of a field, which it keeps.
class KeptIndex {
public:
    KeptIndex(nb::handle field, nb::handle cells)
        : field_(nb::borrow(field)), cells_(nb::borrow(cells)) {
        Argument<Field> known(field, Where{"RayIndex", "field", sizes_});
        Argument<Matrix<const double>> sides(cells, Where{"RayIndex", "cells[4,E]", sizes_});
        Matrix<const double> c = sides.get();
        const Field& f = known.get();
        nb::gil_scoped_release free;
        index_ = std::make_unique<rays::Index>(f, c[0], c[1], c[2], c[3]);
    }
    const rays::Index& index() { return *index_; }
    i64 nbytes() const { return index_->nbytes(); }
    i64 nodes() const { return 4 * count_of(index_->quarters) + 1; }

private:
    nb::object field_, cells_;
    Sizes sizes_;
    std::unique_ptr<rays::Index> index_;
};

}  // namespace

template <> struct Argument<rays::Index> : KnownArgument<KeptIndex> {
    using KnownArgument::KnownArgument;
    const rays::Index& get() { return kept->index(); }
};

void bind_rays(nb::module_ m) {
    nb::class_<KeptIndex>(m, "RayIndex", "Bounds of heights over quarters of the plan, for rays.")
        .def(nb::init<nb::handle, nb::handle>(), "field"_a, "cells"_a)
        .def_prop_ro("nbytes", &KeptIndex::nbytes)
        .def_prop_ro("nodes", &KeptIndex::nodes);
    def<&rays::cast>(
        m, "cast", "What rays meet first; the first that is no ray, or -1.",
        {"index", "origins[n,3]", "directions[n,3]", "most[n]", "distance[n]", "point[n,3]",
         "normal[n,3]", "top[n]", "surface[n]", "wall[n]"}
    );
}

}  // namespace terratool::python
