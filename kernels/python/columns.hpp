// Storeys as Python knows them: sheets, table and lattice, checked once and kept.
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

struct KeptSheet {
    Kept<Field> tops, faces;
    Kept<Span<const i32>> storeys, faced;
    Kept<Span<const i64>> numbers;
    bool is_bore;
    i64 bare;
    double most;

    explicit KeptSheet(nb::handle sheet)
        : tops(sheet, "tops", "Storeys"), faces(sheet, "faces", "Storeys"),
          storeys(sheet, "storeys[_]", "Storeys"), faced(sheet, "faced[_]", "Storeys"),
          numbers(sheet, "numbers[_]", "Storeys"), is_bore(nb::cast<bool>(sheet.attr("is_bore"))),
          bare(nb::cast<i64>(sheet.attr("bare"))), most(nb::cast<double>(sheet.attr("most"))) {}

    Sheet sheet() {
        return {
            &tops.argument().get(),
            &faces.argument().get(),
            storeys.argument().get(),
            numbers.argument().get(),
            faced.argument().get(),
            is_bore,
            bare,
            most
        };
    }
};

// Storeys with all that they look at.
class KeptStoreys {
public:
    KeptStoreys(nb::handle sheets, nb::handle table, nb::handle lattice)
        : table_(nb::borrow(table)), lattice_(nb::borrow(lattice)),
          known_table_(table, Where{"Storeys", "table", table_sizes_}),
          known_lattice_(lattice, Where{"Storeys", "lattice", lattice_sizes_}) {
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
        constexpr IndexCheck check_index{"Storeys"};
        i64 storeys = count_of(storeys_.table.gaps);
        check_index(!storeys_.sheets.empty(), "sheets");
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
