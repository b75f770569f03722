// What Python sees of kernels/field/ray_storeys.hpp.
#include "../field/ray_storeys.hpp"

#include "columns.hpp"
#include "modules.hpp"
#include "rays.hpp"

namespace terratool::python {

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

void bind_ray_storeys(nb::module_ m) {
    nb::class_<KeptStoreyIndex>(m, "StoreyRayIndex", "Indices of storeys and ground, for rays.")
        .def(nb::init<nb::handle, nb::handle, nb::handle>(), "storeys"_a, "ground"_a, "sheets"_a);
    def<&rays::cast_storeys>(
        m, "cast_storeys", "As `cast`, where there are storeys.", {"index", "rays", "hits"}
    );
}

}  // namespace terratool::python
