// Indices of fields for rays, as Python hands them to kernels.
#pragma once

#include "../field/ray_index.hpp"

#include "field.hpp"

#include <memory>

namespace terratool::python {

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

template <> struct Argument<rays::Index> : KnownArgument<KeptIndex> {
    using KnownArgument::KnownArgument;
    const rays::Index& get() { return kept->index(); }
};

}  // namespace terratool::python
