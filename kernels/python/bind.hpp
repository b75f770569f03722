// How Python calls a kernel: arrays are checked and become views, and the GIL is released.
//
//     def<&heights>(m, "heights", "Heights at points.", {"field", "x[n]", "y[n]", "out[n]"});
//
// Names of arguments say the shapes of arrays. A letter stands for one number throughout a call,
// `n+1` for one more, `_` for any. `?out[n]` may be None: a view of nothing. Spans and matrices of
// const are read; others are written to, and must be writable. Whatever is not as it must be is a
// TypeError that names the argument.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <cstring>
#include <initializer_list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <typeinfo>
#include <variant>

#include "../core.hpp"

namespace nb = nanobind;

// What is not a loop over numbers need not be quick, but quickly compiled.
#define COLD [[gnu::cold, gnu::noinline]]
#define NOINLINE [[gnu::noinline]]

namespace terratool::python {

using namespace nb::literals;

// Letters of shapes, and the numbers that they stand for in a call.
class Sizes {
public:
    // Whether `text`, one length of a shape, agrees with a length; a new letter takes it.
    bool agree(std::string_view text, i64 length) {
        if (text == "_") return true;
        if (text[0] >= '0' && text[0] <= '9') return std::stoll(std::string(text)) == length;
        i64 more = text.size() > 2 ? std::stoll(std::string(text.substr(2))) : 0;
        for (auto& [letter, size] : known_)
            if (letter == text[0]) return size + more == length;
        known_.emplace_back(text[0], length - more);
        return length >= more;
    }

private:
    std::vector<std::pair<char, i64>> known_;
};

// What str() says of a value.
inline std::string text_of(nb::handle value) {
    nb::object text = nb::steal(PyObject_Str(value.ptr()));
    if (!text) throw nb::python_error();
    return nb::cast<std::string>(text);
}

// Where an argument is: for what is said of it, and for its shape.
struct Where {
    const char* function;
    std::string_view spelled;  // "x[n]"
    Sizes& sizes;

    bool is_optional() const { return spelled[0] == '?'; }
    std::string_view name() const { return name_of(spelled); }
    static std::string_view name_of(std::string_view spelled) {
        spelled.remove_prefix(spelled[0] == '?');
        return spelled.substr(0, spelled.find('['));
    }
    std::string_view shape() const {
        auto begin = spelled.find('[');
        return begin == spelled.npos ? "" : spelled.substr(begin + 1, spelled.size() - begin - 2);
    }
    [[noreturn]] COLD void refuse(const std::string& wanted, nb::handle got) const {
        std::string found = text_of(got.type().attr("__name__"));
        if (nb::hasattr(got, "dtype") && nb::hasattr(got, "shape")) {
            found = text_of(got.attr("dtype")) + " of shape " + text_of(got.attr("shape"));
            if (!nb::cast<bool>(got.attr("flags").attr("c_contiguous"))) found += ", strided";
            if (!nb::cast<bool>(got.attr("flags").attr("writeable"))) found += ", read-only";
        }
        throw nb::type_error((std::string(function) + "(): " + std::string(name()) + " must be "
                              + wanted + ", but is " + found)
                                 .c_str());
    }
};

// What of the buffer protocol's formats is a type, and what NumPy calls it.
template <class T> struct Dtype;
#define TERRATOOL_DTYPE(T, text, letters)                                                          \
    template <> struct Dtype<T> {                                                                  \
        static constexpr const char* name = text;                                                  \
        static bool is(const Py_buffer& view) {                                                    \
            return view.format && std::strlen(view.format) == 1                                    \
                && std::strchr(letters, view.format[0]) && view.itemsize == Py_ssize_t(sizeof(T)); \
        }                                                                                          \
    };
TERRATOOL_DTYPE(double, "float64", "d")
TERRATOOL_DTYPE(float, "float32", "f")
TERRATOOL_DTYPE(bool, "bool", "?")
TERRATOOL_DTYPE(i16, "int16", "h")
TERRATOOL_DTYPE(i32, "int32", "il")
TERRATOOL_DTYPE(i64, "int64", "lq")
TERRATOOL_DTYPE(u8, "uint8", "B")
TERRATOOL_DTYPE(u16, "uint16", "H")
TERRATOOL_DTYPE(u32, "uint32", "IL")
TERRATOOL_DTYPE(u64, "uint64", "LQ")
#undef TERRATOOL_DTYPE

// A struct that arrays are made of; `visit_members` names its members.
template <class T>
concept Record = requires(T& record) { visit_members(record, [](const char*, auto&) {}); };

// What the buffer protocol calls the NumPy dtype of a record, once `check_record` has seen it.
template <class T> std::string& format_of() {
    static std::string format;
    return format;
}

template <Record T> struct Dtype<T> {
    static constexpr const char* name = "record";
    static bool is(const Py_buffer& view) {
        return view.itemsize == Py_ssize_t(sizeof(T)) && view.format
            && format_of<T>() == view.format;
    }
};

// The NumPy dtypes of records that were checked, by the name in the spec of an array.
inline nb::dict records() {
    nb::module_ here = nb::module_::import_("terratool.kernels");
    if (!nb::hasattr(here, "RECORDS")) here.attr("RECORDS") = nb::dict();
    return nb::cast<nb::dict>(here.attr("RECORDS"));
}

// Refuse a NumPy dtype that is not, member by member, the struct.
template <Record T> void check_record(nb::handle dtype) {
    T record{};
    nb::object fields = dtype.attr("fields");
    std::size_t count = 0;
    auto wrong = [&](const std::string& what) {
        throw nb::type_error(
            (text_of(dtype) + " is not the struct of the kernels: " + what).c_str()
        );
    };
    visit_members(record, [&]<class M>(const char* name, M& member) {
        ++count;
        if (!nb::cast<bool>(fields.attr("__contains__")(name))) wrong(std::string("no ") + name);
        nb::object field = fields[name];
        i64 offset = reinterpret_cast<char*>(&member) - reinterpret_cast<char*>(&record);
        nb::object type = field[0];
        if (nb::cast<i64>(field[1]) != offset
            || text_of(type.attr("base")) != Dtype<std::remove_all_extents_t<M>>::name
            || nb::cast<std::size_t>(type.attr("itemsize")) != sizeof(M))
            wrong(name);
    });
    if (count != nb::len(fields) || nb::cast<std::size_t>(dtype.attr("itemsize")) != sizeof(T))
        wrong("its size");
    nb::object empty = nb::module_::import_("numpy").attr("empty")(1, dtype);
    Py_buffer view;
    if (PyObject_GetBuffer(empty.ptr(), &view, PyBUF_FORMAT | PyBUF_ND)) throw nb::python_error();
    format_of<T>() = view.format;
    PyBuffer_Release(&view);
    records()[typeid(T).name()] = dtype;
}

// Refuse a Python IntEnum that is not the enumeration; `visit_enumerators` names its members.
template <class E> void check_enumeration(nb::handle given) {
    nb::object members = given.attr("__members__");
    std::size_t count = 0;
    bool same = true;
    visit_enumerators(E{}, [&](const char* name, E value) {
        ++count;
        same = same && nb::cast<bool>(members.attr("__contains__")(name))
            && nb::cast<i64>(nb::int_(nb::object(members[name]))) == i64(value);
    });
    if (!same || count != nb::len(members))
        throw nb::type_error((text_of(given) + " is not the enumeration of the kernels").c_str());
}

// The memory of an array, kept while a kernel works on it.
class Buffer {
public:
    Buffer() = default;
    Buffer(Buffer&& other) noexcept : view_(other.view_), lengths_(other.lengths_) {
        other.view_.obj = nullptr;
    }
    Buffer& operator=(Buffer&& other) noexcept {
        std::swap(view_, other.view_);
        std::swap(lengths_, other.lengths_);
        return *this;
    }
    ~Buffer() {
        if (view_.obj) PyBuffer_Release(&view_);
    }

    // Whether a value is an array of T with so many dimensions.
    template <class T> bool take(nb::handle value, int rank) {
        using Element = std::remove_const_t<T>;
        if (view_.obj) PyBuffer_Release(&view_);
        if (PyObject_GetBuffer(value.ptr(), &view_, PyBUF_FORMAT | PyBUF_STRIDES)) {
            PyErr_Clear();
            view_.obj = nullptr;
            return false;
        }
        for (int axis = 0; axis < min(view_.ndim, 3); ++axis) lengths_[axis] = view_.shape[axis];
        return view_.ndim == rank && Dtype<Element>::is(view_) && PyBuffer_IsContiguous(&view_, 'C')
            && (std::is_const_v<T> || !view_.readonly);
    }
    // Whether its shape is the one that is spelled.
    bool agrees(const Where& where) const {
        std::string_view rest = where.shape();
        for (int axis = 0; axis < view_.ndim && !rest.empty(); ++axis) {
            auto comma = rest.find(',');
            if (!where.sizes.agree(rest.substr(0, comma), lengths_[axis])) return false;
            rest = comma == rest.npos ? "" : rest.substr(comma + 1);
        }
        return true;
    }
    bool is_taken() const { return view_.obj != nullptr; }
    template <class T> T* data() const { return static_cast<T*>(view_.buf); }
    i64 length(int axis) const { return lengths_[axis]; }

private:
    Py_buffer view_{};
    std::array<i64, 3> lengths_{};  // what the view says may be within itself, and stay behind
};

// Views by their number of dimensions.
template <class V> struct ViewOf;
template <class T> struct ViewOf<Span<T>> {
    using Element = T;
    static constexpr int rank = 1;
    static Span<T> of(const Buffer& b) { return {b.data<T>(), std::size_t(b.length(0))}; }
};
template <class T> struct ViewOf<Matrix<T>> {
    using Element = T;
    static constexpr int rank = 2;
    static Matrix<T> of(const Buffer& b) { return {b.data<T>(), b.length(0), b.length(1)}; }
};
template <class T> struct ViewOf<Cube<T>> {
    using Element = T;
    static constexpr int rank = 3;
    static Cube<T> of(const Buffer& b) {
        return {b.data<T>(), b.length(0), b.length(1), b.length(2)};
    }
};

template <class V>
concept View = requires { ViewOf<V>::rank; };

// A struct of views and numbers that a kernel takes as one argument; `visit_arguments` names them.
template <class T>
concept Bundle = requires(T& bundle) { visit_arguments(bundle, [](const char*, auto&) {}); };

// Refuses, for the object of this name, what leads beyond an array: kernels follow indices.
struct IndexCheck {
    const char* object;
    void operator()(bool good, const char* what) const {
        if (!good)
            throw nb::type_error((std::string(object) + "(): " + what + " leads nowhere").c_str());
    }
};

// An object of a class that Python knows.
template <class T> struct KnownArgument {
    T* kept;
    COLD static std::string type() { return text_of(nb::type<T>().attr("__name__")); }
    NOINLINE KnownArgument(nb::handle given, const Where& where) {
        // one that __new__ alone has made holds nothing
        if (!nb::isinstance<T>(given) || !nb::inst_ready(given)) where.refuse("a " + type(), given);
        kept = nb::inst_ptr<T>(given);
    }
};

// How a Python value becomes an argument of a kernel, and what its type is called in a signature.
template <class T> struct Argument : KnownArgument<T> {
    using KnownArgument<T>::KnownArgument;
    T& get() { return *this->kept; }
};

// What tests are told of an argument: what an array must be, or the type of anything else.
template <class T> nb::dict spec_of() {
    if constexpr (requires { Argument<T>::spec(); }) return Argument<T>::spec();
    nb::dict spec;
    spec["type"] = Argument<T>::type();
    return spec;
}

template <View V> struct Argument<V> {
    using Of = ViewOf<V>;
    using Element = std::remove_const_t<typename Of::Element>;
    static constexpr bool writes = !std::is_const_v<typename Of::Element>;
    Buffer buffer;

    COLD static std::string type() {
        if constexpr (Record<Element>) return "NDArray[np.void]";
        else if constexpr (std::is_same_v<Element, bool>) return "NDArray[np.bool_]";
        else return std::string("NDArray[np.") + Dtype<Element>::name + "]";
    }
    COLD static std::string wanted(const Where& where) {
        return std::string("a ") + (writes ? "writable, " : "") + "contiguous array of "
            + std::to_string(Of::rank) + (Of::rank == 1 ? " dimension, " : " dimensions, ")
            + Dtype<Element>::name + " (" + std::string(where.shape()) + ")";
    }
    COLD static nb::dict spec() {
        nb::dict spec;
        if constexpr (Record<Element>) spec["record"] = typeid(Element).name();
        else spec["dtype"] = Dtype<Element>::name;
        spec["rank"] = Of::rank;
        spec["writes"] = writes;
        return spec;
    }
    // Whether the value is such an array; its lengths are another matter.
    bool take(nb::handle given) { return buffer.take<typename Of::Element>(given, Of::rank); }

    Argument() = default;
    NOINLINE Argument(nb::handle given, const Where& where) {
        if (where.is_optional() && given.is_none()) return;
        if (!take(given) || !buffer.agrees(where)) where.refuse(wanted(where), given);
    }
    V get() { return buffer.is_taken() ? Of::of(buffer) : V(); }
};

// One of several kinds of view; the first that fits.
template <View... V> struct Argument<std::variant<V...>> {
    std::variant<Argument<V>...> chosen;

    COLD static std::string type() {
        std::string words;
        ((words += (words.empty() ? "" : " | ") + Argument<V>::type()), ...);
        return words;
    }
    COLD static nb::dict spec() {
        nb::list choices;
        (choices.append(Argument<V>::spec()), ...);
        nb::dict spec;
        spec["choices"] = choices;
        return spec;
    }
    NOINLINE Argument(nb::handle given, const Where& where) {
        if (where.is_optional() && given.is_none()) return;
        bool found = (try_one<V>(given) || ...);
        bool fits =
            found && std::visit([&](auto& one) { return one.buffer.agrees(where); }, chosen);
        if (fits) return;
        std::string words;
        ((words += (words.empty() ? "" : " or ") + Argument<V>::wanted(where)), ...);
        where.refuse(words, given);
    }
    std::variant<V...> get() {
        return std::visit([](auto& one) { return std::variant<V...>(one.get()); }, chosen);
    }

private:
    template <class One> bool try_one(nb::handle given) {
        return chosen.template emplace<Argument<One>>().take(given);
    }
};

template <> struct Argument<double> {
    double value;
    COLD static std::string type() { return "float"; }
    NOINLINE Argument(nb::handle given, const Where& where) : value(PyFloat_AsDouble(given.ptr())) {
        if (value == -1.0 && PyErr_Occurred()) {
            PyErr_Clear();
            where.refuse("a number", given);
        }
    }
    double get() { return value; }
};

template <> struct Argument<i64> {
    i64 value = 0;
    COLD static std::string type() { return "int"; }
    NOINLINE Argument(nb::handle given, const Where& where) {
        nb::object whole = nb::steal(PyNumber_Index(given.ptr()));
        if (whole) value = PyLong_AsLongLong(whole.ptr());
        if (PyErr_Occurred()) {
            PyErr_Clear();
            where.refuse("a whole number of 64 bits", given);
        }
    }
    i64 get() { return value; }
};

template <> struct Argument<bool> {
    bool value;
    COLD static std::string type() { return "bool"; }
    NOINLINE Argument(nb::handle given, const Where& where) {
        if (!PyBool_Check(given.ptr())) {
            std::string name = text_of(given.type().attr("__name__"));  // NumPy's
            if (name != "bool" && name != "bool_") where.refuse("True or False", given);
        }
        value = PyObject_IsTrue(given.ptr()) == 1;
    }
    bool get() { return value; }
};

// The members of a bundle, taken one after the other from the attributes of a value.
template <Bundle B> class Bundled {
public:
    COLD static std::string type() { return "Any"; }
    COLD static nb::dict spec() {
        nb::list members;
        B bundle{};
        visit_arguments(bundle, [&]<class T>(const char* spelled, T&) {
            using Plain = std::remove_const_t<std::remove_pointer_t<T>>;
            nb::dict spec = spec_of<Plain>();
            spec["spelled"] = spelled;
            members.append(spec);
        });
        nb::dict spec;
        spec["members"] = members;
        return spec;
    }
    NOINLINE Bundled(nb::handle given, const Where& where) { fill(bundle_, given, where); }
    B& get() { return bundle_; }

private:
    B bundle_{};
    std::vector<std::shared_ptr<void>> held_;  // keeps memory

    template <class M> void fill(M& record, nb::handle given, const Where& where) {
        visit_arguments(record, [&]<class T>(const char* spelled, T& member) {
            bool optional = spelled[0] == '?';
            std::string full =
                (optional ? "?" : "") + std::string(where.name()) + "." + (spelled + optional);
            Where here{where.function, full, where.sizes};
            std::string name(Where::name_of(spelled));
            if (!nb::hasattr(given, name.c_str())) where.refuse("something with ." + name, given);
            nb::object value = given.attr(name.c_str());
            if constexpr (Bundle<T>) {
                fill(member, value, here);
            } else if constexpr (std::is_pointer_v<T>) {  // of a class that Python knows
                using Known = std::remove_const_t<std::remove_pointer_t<T>>;
                member = &Argument<Known>(value, here).get();
                held_.push_back(std::make_shared<nb::object>(value));
            } else {
                auto argument = std::make_shared<Argument<T>>(value, here);
                member = argument->get();
                held_.push_back(argument);
            }
        });
    }
};

template <Bundle B> struct Argument<B> : Bundled<B> {
    using Bundled<B>::Bundled;
};

// An array of T that takes over the memory of a vector.
template <class T, class Made>
nb::object array_of(Made&& made, std::initializer_list<std::size_t> shape) {
    auto* kept = new Made(std::move(made));
    nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<Made*>(p); });
    auto* data = reinterpret_cast<T*>(kept->data());
    return nb::cast(nb::ndarray<nb::numpy, T>(data, shape.size(), shape.begin(), owner));
}

// How the result of a kernel becomes a Python value, and what its type is called.
template <class R> struct Result {
    COLD static std::string type() {
        if constexpr (std::is_same_v<R, bool>) return "bool";
        else if constexpr (std::is_integral_v<R>) return "int";
        else if constexpr (std::is_floating_point_v<R>) return "float";
        else return "Any";
    }
    static nb::object of(R&& value) { return nb::cast(std::move(value)); }
};

// Text comes as bytes.
template <> struct Result<std::string> {
    COLD static std::string type() { return "bytes"; }
    static nb::object of(std::string&& text) { return nb::bytes(text.data(), text.size()); }
};

template <class T> struct Result<std::vector<T>> {
    COLD static std::string type() { return Argument<Span<T>>::type(); }
    static nb::object of(std::vector<T>&& made) {
        return array_of<T>(std::move(made), {made.size()});
    }
};

template <class T, std::size_t width> struct Result<std::vector<std::array<T, width>>> {
    COLD static std::string type() { return Argument<Matrix<T>>::type(); }
    static nb::object of(std::vector<std::array<T, width>>&& made) {
        return array_of<T>(std::move(made), {made.size(), width});
    }
};

// A record by itself becomes a dictionary; none of it None.
template <Record T> struct Result<T> {
    COLD static std::string type() { return "dict[str, Any]"; }
    static nb::object of(T&& record) {
        nb::dict made;
        visit_members(record, [&](const char* name, auto& member) { made[name] = member; });
        return made;
    }
};

template <class R> struct Result<std::optional<R>> {
    COLD static std::string type() { return Result<R>::type() + " | None"; }
    static nb::object of(std::optional<R>&& value) {
        return value ? Result<R>::of(std::move(*value)) : nb::none();
    }
};

// Pairs come as a list: there are few, as a rule.
template <class A, class B> struct Result<std::vector<std::pair<A, B>>> {
    COLD static std::string type() {
        return "list[tuple[" + Result<A>::type() + ", " + Result<B>::type() + "]]";
    }
    static nb::object of(std::vector<std::pair<A, B>>&& made) {
        nb::list list;
        for (auto& [a, b] : made) list.append(nb::make_tuple(a, b));
        return list;
    }
};

// Records come as bytes; whoever has the dtype views them by it.
template <Record T> struct Result<std::vector<T>> {
    COLD static std::string type() { return "NDArray[np.uint8]"; }
    static nb::object of(std::vector<T>&& made) {
        return array_of<u8>(std::move(made), {made.size() * sizeof(T)});
    }
};

template <class... R> struct Result<std::tuple<R...>> {
    COLD static std::string type() {
        std::string words;
        ((words += (words.empty() ? "" : ", ") + Result<R>::type()), ...);
        return "tuple[" + words + "]";
    }
    static nb::object of(std::tuple<R...>&& made) {
        return std::apply(
            [](auto&&... one) {
                return nb::object(nb::make_tuple(Result<R>::of(std::move(one))...));
            },
            std::move(made)
        );
    }
};

template <std::size_t> using Handle = nb::handle;

// Makes the function that Python calls from one in C++.
template <auto kernel, class R, class... A> struct Caller {
    static constexpr std::size_t count = sizeof...(A);

    template <class Scope, std::size_t... I>
    COLD static void bind(
        Scope& scope, const char* name, const char* doc, std::initializer_list<const char*> spelled,
        std::index_sequence<I...>
    ) {
        std::array<const char*, count> names{};
        std::copy(spelled.begin(), spelled.end(), names.begin());
        std::string signature = std::string("def ") + name + "(", shapes;
        std::array<std::string, count> types{Argument<std::remove_cvref_t<A>>::type()...};
        for (std::size_t k = 0; k < count; ++k) {
            std::string_view text = names[k], own = Where::name_of(text);
            bool optional = text[0] == '?';
            text.remove_prefix(optional);
            if (k) signature += ", ";
            signature += std::string(own) + ": " + types[k];
            if (optional) signature += " | None";
            if (own.size() < text.size())
                shapes += (shapes.empty() ? "" : ", ") + std::string(text);
        }
        std::string returned = "None";
        if constexpr (!std::is_void_v<R>) returned = Result<R>::type();
        signature += ") -> " + returned;
        nb::list specs;
        auto add_spec = [&](nb::dict spec, const char* text) {
            spec["spelled"] = text;
            specs.append(spec);
        };
        (add_spec(spec_of<std::remove_cvref_t<A>>(), names[I]), ...);
        if (!nb::hasattr(scope, "SPECS")) scope.attr("SPECS") = nb::dict();
        scope.attr("SPECS")[name] = specs;
        std::string words = doc + (shapes.empty() ? "" : "\n\nShapes: " + shapes + ".");
        scope.def(
            name,
            [names, name](Handle<I>... given) -> nb::object {
                Sizes sizes;
                // braces keep the order, in which letters of shapes are met
                std::tuple<Argument<std::remove_cvref_t<A>>...> arguments{
                    Argument<std::remove_cvref_t<A>>(given, Where{name, names[I], sizes})...
                };
                if constexpr (std::is_void_v<R>) {
                    nb::gil_scoped_release free;
                    kernel(std::get<I>(arguments).get()...);
                } else {
                    R result = [&] {
                        nb::gil_scoped_release free;
                        return kernel(std::get<I>(arguments).get()...);
                    }();
                    return Result<R>::of(std::move(result));
                }
                return nb::none();
            },
            words.c_str(), nb::sig(signature.c_str()),
            // None gets as far as to Argument, which knows where it may be
            nb::arg(argument_name(names[I]).c_str()).none()...
        );
    }
    static std::string argument_name(std::string_view spelled) {
        return std::string(Where::name_of(spelled));
    }
};

template <auto kernel, class R, class... A> auto caller(R (*)(A...)) -> Caller<kernel, R, A...>;

// A method is a function whose first argument is the object.
template <auto method, class R, class C, class... A> R call_method(C& self, A... arguments) {
    return (self.*method)(arguments...);
}
template <auto method, class R, class C, class... A>
auto caller(R (C::*)(A...)) -> Caller<&call_method<method, R, C, A...>, R, C&, A...>;

// Let Python call `kernel`, a function or a method, by this name.
template <auto kernel>
void def(
    nb::module_& scope, const char* name, const char* doc,
    std::initializer_list<const char*> spelled
) {
    using Made = decltype(caller<kernel>(kernel));
    if (spelled.size() != Made::count) throw std::logic_error(std::string(name) + ": names");
    Made::bind(scope, name, doc, spelled, std::make_index_sequence<Made::count>());
}

}  // namespace terratool::python
