// A compiled field as Python knows it: its arrays, checked once.
#pragma once

#include "../field/types.hpp"
#include "bind.hpp"

namespace terratool::python {

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
