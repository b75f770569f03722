// A compiled field as Python knows it: its arrays, checked once.
#pragma once

#include "../field/types.hpp"
#include "bind.hpp"

namespace terratool::python {

// Memory of files with heights of grids as Python knows it: an array of bytes for each, and what
// reads its blocks, or None where all are there.
class KeptGridMemory {
public:
    KeptGridMemory(nb::handle files, nb::handle blocks);
    KeptGridMemory(const KeptGridMemory&) = delete;
    const GridBytes& bytes() { return bytes_; }

private:
    std::vector<Buffer> held_;
    GridBytes bytes_;
};

template <> struct Argument<GridBytes> : KnownArgument<KeptGridMemory> {
    using KnownArgument::KnownArgument;
    const GridBytes& get() { return kept->bytes(); }
};

class KeptField {
public:
    explicit KeptField(nb::handle arrays) : arrays_(arrays, Where{"Field", "arrays", sizes_}) {
        check();
    }
    const Field& field() { return arrays_.get(); }

private:
    Sizes sizes_;
    Bundled<Field> arrays_;

    void check();
};

template <> struct Argument<Field> : KnownArgument<KeptField> {
    Argument(nb::handle given, const Where& where) : KnownArgument(given, where) {
        if (!where.sizes.agree("E", count_of(get().elements)))  // E stands for its elements
            where.refuse("a Field of as many elements", given);
    }
    const Field& get() { return kept->field(); }
};

}  // namespace terratool::python
