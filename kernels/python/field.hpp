// A compiled field as Python knows it: its arrays, checked once.
#pragma once

#include "../field/types.hpp"
#include "bind.hpp"

namespace terratool::python {

// Refuse an index that leads nowhere: whoever holds a field may follow all of them.
inline void check_index(bool good, const char* what) {
    if (!good) throw nb::type_error((std::string("Field(): ") + what + " leads nowhere").c_str());
}

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

template <> struct Argument<Field> {
    KeptField* kept;
    static std::string type() { return "Field"; }
    Argument(nb::handle given, const Where& where) {
        if (!nb::isinstance<KeptField>(given)) where.refuse("a Field", given);
        kept = nb::inst_ptr<KeptField>(given);
        if (!where.sizes.agree("E", count_of(get().elements)))  // E stands for its elements
            where.refuse("a Field of as many elements", given);
    }
    const Field& get() { return kept->field(); }
};

}  // namespace terratool::python
