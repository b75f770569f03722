// Storeys as Python hands them to kernels.
#pragma once

#include "../field/columns.hpp"

#include "field.hpp"

#include <memory>

namespace terratool::python {

// A view of an array, or a bundle, by the name of an attribute of a value that is kept.
template <class T> class Kept {
public:
    Kept(nb::handle of, const char* spelled, const char* function)
        : value_(of.attr(std::string(Where::name_of(spelled)).c_str())),
          argument_(std::make_unique<Argument<T>>(value_, Where{function, spelled, *sizes_})) {}
    auto& argument() { return *argument_; }

private:
    nb::object value_;
    std::unique_ptr<Sizes> sizes_ = std::make_unique<Sizes>();
    std::unique_ptr<Argument<T>> argument_;
};

inline constexpr const char* STOREYS = "Storeys";

struct KeptSheet {
    Kept<Field> tops, faces;
    Kept<Span<const i32>> storeys, faced;
    Kept<Span<const i64>> numbers;
    i64 bare;
    bool is_bore;

    explicit KeptSheet(nb::handle sheet)
        : tops(sheet, "tops", STOREYS), faces(sheet, "faces", STOREYS),
          storeys(sheet, "storeys[_]", STOREYS), faced(sheet, "faced[_]", STOREYS),
          numbers(sheet, "numbers[_]", STOREYS), bare(nb::cast<i64>(sheet.attr("bare"))),
          is_bore(nb::cast<bool>(sheet.attr("is_bore"))) {}

    Sheet sheet() {
        return {
            &tops.argument().get(),
            &faces.argument().get(),
            storeys.argument().get(),
            numbers.argument().get(),
            faced.argument().get(),
            bare,
            is_bore
        };
    }
};

// Storeys with all that they look at.
class KeptStoreys {
public:
    KeptStoreys(nb::handle sheets, nb::handle table, nb::handle lattice)
        : table_(nb::borrow(table)), lattice_(nb::borrow(lattice)),
          known_table_(table, Where{STOREYS, "table", table_sizes_}),
          known_lattice_(lattice, Where{STOREYS, "lattice", lattice_sizes_}) {
        storeys_.table = known_table_.get(), storeys_.lattice = known_lattice_.get();
        for (nb::handle sheet : sheets) {
            kept_.push_back(std::make_unique<KeptSheet>(sheet));
            storeys_.sheets.push_back(kept_.back()->sheet());
        }
        check();
    }
    const Storeys& storeys() const { return storeys_; }

private:
    nb::object table_, lattice_;
    Sizes table_sizes_, lattice_sizes_;
    Bundled<StoreyTable> known_table_;
    Bundled<StoreyLattice> known_lattice_;
    std::vector<std::unique_ptr<KeptSheet>> kept_;
    Storeys storeys_;

    void check() const {
        constexpr IndexCheck check_index{STOREYS};
        i64 storeys = count_of(storeys_.table.gaps);
        for (const Sheet& sheet : storeys_.sheets) {
            std::size_t tops = sheet.tops->elements.size(), faces = sheet.faces->elements.size();
            bool all = sheet.storeys.size() == tops && sheet.numbers.size() == tops;
            check_index(all && sheet.faced.size() == faces, "a sheet");
            for (i32 storey : sheet.storeys) check_index(storey < storeys, "the storey of a top");
            for (i32 storey : sheet.faced) check_index(storey < storeys, "the storey of a face");
        }
    }
};

template <> struct Argument<Storeys> : KnownArgument<KeptStoreys> {
    using KnownArgument::KnownArgument;
    const Storeys& get() { return kept->storeys(); }
};

}  // namespace terratool::python
