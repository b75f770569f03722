// What Python sees of kernels/field/rays.hpp and ray_storeys.hpp.
#include "../field/ray_storeys.hpp"

#include "columns.hpp"
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

namespace {

// Storeys and the indices of all that rays may meet, which it keeps.
class KeptStoreyIndex {
public:
    KeptStoreyIndex(nb::handle storeys, nb::handle ground, nb::handle sheets)
        : kept_(nb::make_tuple(storeys, ground, sheets)),
          index_{known<Storeys>(storeys), known<rays::Index>(ground), {}, {}} {
        for (nb::handle sheet : sheets) {
            index_.tops.push_back(&known<rays::Index>(sheet[0]));
            index_.faces.push_back(&known<rays::Index>(sheet[1]));
        }
        check();
    }
    const rays::StoreyIndex& index() const { return index_; }

private:
    nb::object kept_;
    rays::StoreyIndex index_;

    template <class T> static const T& known(nb::handle given) {
        Sizes sizes;
        return Argument<T>(given, Where{"StoreyRayIndex", "index", sizes}).get();
    }

    // The indices have as many elements as the fields of the sheets.
    void check() const {
        constexpr IndexCheck check_index{"StoreyRayIndex"};
        const auto& sheets = index_.storeys.sheets;
        check_index(sheets.size() == index_.tops.size(), "a sheet");
        for (std::size_t k = 0; k < sheets.size(); ++k) {
            check_index(index_.tops[k]->field.elements.size() == sheets[k].storeys.size(), "tops");
            check_index(index_.faces[k]->field.elements.size() == sheets[k].faced.size(), "faces");
        }
    }
};

}  // namespace

template <> struct Argument<rays::StoreyIndex> : KnownArgument<KeptStoreyIndex> {
    using KnownArgument::KnownArgument;
    const rays::StoreyIndex& get() { return kept->index(); }
};

void bind_rays(nb::module_ m) {
    nb::class_<KeptIndex>(m, "RayIndex", "Bounds of heights over quarters of the plan, for rays.")
        .def(nb::init<nb::handle, nb::handle>(), "field"_a, "cells"_a)
        .def_prop_ro("nbytes", &KeptIndex::nbytes)
        .def_prop_ro("nodes", &KeptIndex::nodes);
    def<&rays::cast>(
        m, "cast", "What rays meet first; the first that is no ray, or -1.",
        {"index", "rays", "hits"}
    );

    nb::class_<KeptStoreyIndex>(m, "StoreyRayIndex", "Indices of storeys and ground, for rays.")
        .def(nb::init<nb::handle, nb::handle, nb::handle>(), "storeys"_a, "ground"_a, "sheets"_a);
    def<&rays::cast_storeys>(
        m, "cast_storeys", "As `cast`, where there are storeys.", {"index", "rays", "hits"}
    );
}

}  // namespace terratool::python
