// How Python calls a kernel: what is the same for all of them, and so compiled once.
#include "bind.hpp"

#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <cstring>
#include <stdexcept>

namespace terratool::python {

namespace {

// No kernel takes more arguments.
constexpr std::size_t MOST_ARGUMENTS = 12;

std::string joined(const std::string& words, const char* between, const std::string& more) {
    return words.empty() ? more : words + between + more;
}

[[noreturn]] void refuse_type(const std::string& words) { throw nb::type_error(words.c_str()); }

// The NumPy dtypes of records that were checked, by the name in the spec of an array.
nb::dict records() {
    nb::module_ here = nb::module_::import_("terratool.kernels");
    if (!nb::hasattr(here, "RECORDS")) here.attr("RECORDS") = nb::dict();
    return nb::cast<nb::dict>(here.attr("RECORDS"));
}

}  // namespace

bool Sizes::agree(std::string_view text, i64 length) {
    if (text == "_") return true;
    if (text[0] >= '0' && text[0] <= '9') return std::stoll(std::string(text)) == length;
    i64 more = text.size() > 2 ? std::stoll(std::string(text.substr(2))) : 0;
    for (auto& [letter, size] : known_)
        if (letter == text[0]) return size + more == length;
    known_.emplace_back(text[0], length - more);
    return length >= more;
}

std::string text_of(nb::handle value) {
    nb::object text = nb::steal(PyObject_Str(value.ptr()));
    if (!text) throw nb::python_error();
    return nb::cast<std::string>(text);
}

std::string_view Where::name_of(std::string_view spelled) {
    spelled.remove_prefix(spelled[0] == '?');
    return spelled.substr(0, spelled.find('['));
}

std::string_view Where::shape() const {
    auto begin = spelled.find('[');
    return begin == spelled.npos ? "" : spelled.substr(begin + 1, spelled.size() - begin - 2);
}

void Where::refuse(const std::string& wanted, nb::handle got) const {
    std::string found = text_of(got.type().attr("__name__"));
    if (nb::hasattr(got, "dtype") && nb::hasattr(got, "shape")) {
        found = text_of(got.attr("dtype")) + " of shape " + text_of(got.attr("shape"));
        if (!nb::cast<bool>(got.attr("flags").attr("c_contiguous"))) found += ", strided";
        if (!nb::cast<bool>(got.attr("flags").attr("writeable"))) found += ", read-only";
    }
    refuse_type(
        std::string(function) + "(): " + std::string(name()) + " must be " + wanted + ", but is "
        + found
    );
}

bool Dtype::is(const Py_buffer& view) const {
    if (!view.format || view.itemsize != Py_ssize_t(size)) return false;
    if (record) return *format == view.format;
    return std::strlen(view.format) == 1 && std::strchr(letters, view.format[0]);
}

void check_members(
    nb::handle dtype, const std::vector<MemberAt>& members, const Dtype& record, std::string& format
) {
    nb::object fields = dtype.attr("fields");
    auto wrong = [&](const std::string& what) {
        refuse_type(text_of(dtype) + " is not the struct of the kernels: " + what);
    };
    for (const MemberAt& member : members) {
        if (!nb::cast<bool>(fields.attr("__contains__")(member.name)))
            wrong(std::string("no ") + member.name);
        nb::object field = fields[member.name];
        nb::object type = field[0];
        if (nb::cast<i64>(field[1]) != member.offset || text_of(type.attr("base")) != member.type
            || nb::cast<std::size_t>(type.attr("itemsize")) != member.size)
            wrong(member.name);
    }
    if (members.size() != nb::len(fields)
        || nb::cast<std::size_t>(dtype.attr("itemsize")) != record.size)
        wrong("its size");
    nb::object empty = nb::module_::import_("numpy").attr("empty")(1, dtype);
    Py_buffer view;
    if (PyObject_GetBuffer(empty.ptr(), &view, PyBUF_FORMAT | PyBUF_ND)) throw nb::python_error();
    format = view.format;
    PyBuffer_Release(&view);
    records()[record.record] = dtype;
}

void check_enumerators(nb::handle given, const std::vector<std::pair<const char*, i64>>& wanted) {
    nb::object members = given.attr("__members__");
    bool same = wanted.size() == nb::len(members);
    for (auto& [name, value] : wanted)
        same = same && nb::cast<bool>(members.attr("__contains__")(name))
            && nb::cast<i64>(nb::int_(nb::object(members[name]))) == value;
    if (!same) refuse_type(text_of(given) + " is not the enumeration of the kernels");
}

std::string ArrayKind::type() const {
    std::string name = element.name;
    if (element.record) name = "void";
    if (name == "bool") name = "bool_";
    return "NDArray[np." + name + "]";
}

std::string ArrayKind::wanted(const Where& where) const {
    return std::string("a ") + (writes ? "writable, " : "") + "contiguous array of "
        + std::to_string(rank) + (rank == 1 ? " dimension, " : " dimensions, ") + element.name
        + " (" + std::string(where.shape()) + ")";
}

nb::dict ArrayKind::spec() const {
    nb::dict spec;
    if (element.record) spec["record"] = element.record;
    else spec["dtype"] = element.name;
    spec["rank"] = rank;
    spec["writes"] = writes;
    return spec;
}

Buffer::Buffer(nb::handle given, const Where& where, Span<const ArrayKind> kinds) {
    if (where.is_optional() && given.is_none()) return;
    for (kind_ = 0; kind_ < kinds.size(); ++kind_)
        if (take(given, kinds[kind_])) break;
    if (kind_ < kinds.size() && agrees(where)) return;
    if (view_.obj) PyBuffer_Release(&view_);
    std::string words;
    for (const ArrayKind& kind : kinds) words = joined(words, " or ", kind.wanted(where));
    where.refuse(words, given);
}

// Whether a value is such an array; its lengths are another matter.
bool Buffer::take(nb::handle value, const ArrayKind& kind) {
    if (view_.obj) PyBuffer_Release(&view_);
    if (PyObject_GetBuffer(value.ptr(), &view_, PyBUF_FORMAT | PyBUF_STRIDES)) {
        PyErr_Clear();
        view_.obj = nullptr;
        return false;
    }
    for (int axis = 0; axis < min(view_.ndim, 3); ++axis) lengths_[axis] = view_.shape[axis];
    return view_.ndim == kind.rank && kind.element.is(view_) && PyBuffer_IsContiguous(&view_, 'C')
        && !(kind.writes && view_.readonly);
}

// Whether its shape is the one that is spelled.
bool Buffer::agrees(const Where& where) const {
    std::string_view rest = where.shape();
    for (int axis = 0; axis < view_.ndim && !rest.empty(); ++axis) {
        auto comma = rest.find(',');
        if (!where.sizes.agree(rest.substr(0, comma), lengths_[axis])) return false;
        rest = comma == rest.npos ? "" : rest.substr(comma + 1);
    }
    return true;
}

void IndexCheck::refuse(const char* what) const {
    refuse_type(std::string(object) + "(): " + what + " leads nowhere");
}

nb::dict spec_of_type(const std::string& type) {
    nb::dict spec;
    spec["type"] = type;
    return spec;
}

void check_known(nb::handle given, nb::handle type, const Where& where) {
    auto* wanted = reinterpret_cast<PyTypeObject*>(type.ptr());
    if (!PyObject_TypeCheck(given.ptr(), wanted) || !nb::inst_ready(given))
        where.refuse("a " + text_of(type.attr("__name__")), given);
}

std::string type_of_choice(Span<const ArrayKind> kinds) {
    std::string words;
    for (const ArrayKind& kind : kinds) words = joined(words, " | ", kind.type());
    return words;
}

nb::dict spec_of_choice(Span<const ArrayKind> kinds) {
    nb::list choices;
    for (const ArrayKind& kind : kinds) choices.append(kind.spec());
    nb::dict spec;
    spec["choices"] = choices;
    return spec;
}

Argument<double>::Argument(nb::handle given, const Where& where)
    : value(PyFloat_AsDouble(given.ptr())) {
    if (value == -1.0 && PyErr_Occurred()) {
        PyErr_Clear();
        where.refuse("a number", given);
    }
}

Argument<i64>::Argument(nb::handle given, const Where& where) {
    nb::object whole = nb::steal(PyNumber_Index(given.ptr()));
    if (whole) value = PyLong_AsLongLong(whole.ptr());
    if (PyErr_Occurred()) {
        PyErr_Clear();
        where.refuse("a whole number of 64 bits", given);
    }
}

Argument<bool>::Argument(nb::handle given, const Where& where) {
    if (!PyBool_Check(given.ptr())) {
        std::string name = text_of(given.type().attr("__name__"));  // NumPy's
        if (name != "bool" && name != "bool_") where.refuse("True or False", given);
    }
    value = PyObject_IsTrue(given.ptr()) == 1;
}

MemberArgument::MemberArgument(nb::handle given, const char* spelled, const Where& of)
    : full(
          (spelled[0] == '?' ? "?" : "") + std::string(of.name()) + "."
          + (spelled + (spelled[0] == '?'))
      ),
      where{of.function, full, of.sizes} {
    std::string name(Where::name_of(spelled));
    if (!nb::hasattr(given, name.c_str())) of.refuse("something with ." + name, given);
    value = given.attr(name.c_str());
}

void add_spec(nb::list& specs, nb::dict spec, const char* spelled) {
    spec["spelled"] = spelled;
    specs.append(spec);
}

nb::dict spec_of_members(const nb::list& members) {
    nb::dict spec;
    spec["members"] = members;
    return spec;
}

nb::object array_over(
    void* data, const Dtype& element, std::initializer_list<std::size_t> shape, nb::handle owner
) {
    auto code = element.letters[0] == 'd' || element.letters[0] == 'f'
        ? nb::dlpack::dtype_code::Float
        : element.letters[0] == '?' ? nb::dlpack::dtype_code::Bool
        : element.name[0] == 'u'    ? nb::dlpack::dtype_code::UInt
                                    : nb::dlpack::dtype_code::Int;
    nb::dlpack::dtype type{u8(code), u8(element.size * 8), 1};
    return nb::cast(
        nb::ndarray<nb::numpy>(data, shape.size(), shape.begin(), owner, nullptr, type)
    );
}

namespace {

template <std::size_t> using Handle = nb::handle;

// Python's function of so many arguments.
template <std::size_t... I>
void define_with(
    nb::module_& scope, const char* name, const std::string& doc, const std::string& signature,
    std::initializer_list<const char*> spelled, const Kernel& kernel, std::index_sequence<I...>
) {
    std::array<const char*, sizeof...(I)> names{};
    std::copy(spelled.begin(), spelled.end(), names.begin());
    scope.def(
        name,
        [names, name, call = kernel.call](Handle<I>... given) -> nb::object {
            std::array<nb::handle, sizeof...(I)> all{given...};
            Call from{name, names.data(), all.data(), {}};
            return call(from);
        },
        doc.c_str(), nb::sig(signature.c_str()),
        // None gets as far as to Argument, which knows where it may be
        nb::arg(std::string(Where::name_of(names[I])).c_str()).none()...
    );
}

}  // namespace

void define(
    nb::module_& scope, const char* name, const char* doc,
    std::initializer_list<const char*> spelled, const Kernel& kernel
) {
    std::string signature = std::string("def ") + name + "(", shapes;
    nb::list specs;
    const std::size_t count = kernel.arguments.size();
    if (spelled.size() != count) throw std::logic_error(std::string(name) + ": names");
    for (std::size_t k = 0; k < count; ++k) {
        std::string_view text = spelled.begin()[k], own = Where::name_of(text);
        bool optional = text[0] == '?';
        add_spec(specs, kernel.arguments[k].spec(), text.data());
        text.remove_prefix(optional);
        if (k) signature += ", ";
        signature += std::string(own) + ": " + kernel.arguments[k].type();
        if (optional) signature += " | None";
        if (own.size() < text.size()) shapes = joined(shapes, ", ", std::string(text));
    }
    signature += ") -> " + kernel.returned();
    if (!nb::hasattr(scope, "SPECS")) scope.attr("SPECS") = nb::dict();
    scope.attr("SPECS")[name] = specs;
    std::string words = doc + (shapes.empty() ? "" : "\n\nShapes: " + shapes + ".");
    bool bound = [&]<std::size_t... N>(std::index_sequence<N...>) {
        auto try_count = [&]<std::size_t n>(std::integral_constant<std::size_t, n>) {
            if (n != count) return false;
            auto places = std::make_index_sequence<n>();
            define_with(scope, name, words, signature, spelled, kernel, places);
            return true;
        };
        return (try_count(std::integral_constant<std::size_t, N + 1>()) || ...);
    }(std::make_index_sequence<MOST_ARGUMENTS>());
    if (!bound) throw std::logic_error(std::string(name) + ": more arguments than MOST_ARGUMENTS");
}

}  // namespace terratool::python
