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

#include <array>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <typeinfo>
#include <variant>
#include <vector>

#include "../core.hpp"

namespace nb = nanobind;

// What is not a loop over numbers need not be quick, but quickly compiled: templates here say what
// an argument is, and bind.cpp, which is compiled once, does the rest.
#define COLD [[gnu::cold, gnu::noinline]]

namespace terratool::python {

using namespace nb::literals;

// Letters of shapes, and the numbers that they stand for in a call.
class Sizes {
public:
    // Whether `text`, one length of a shape, agrees with a length; a new letter takes it.
    bool agree(std::string_view text, i64 length);

private:
    std::vector<std::pair<char, i64>> known_;
};

// What str() says of a value.
std::string text_of(nb::handle value);

// Where an argument is: for what is said of it, and for its shape.
struct Where {
    const char* function;
    std::string_view spelled;  // "x[n]"
    Sizes& sizes;

    bool is_optional() const { return spelled[0] == '?'; }
    std::string_view name() const { return name_of(spelled); }
    static std::string_view name_of(std::string_view spelled);
    std::string_view shape() const;
    [[noreturn]] void refuse(const std::string& wanted, nb::handle got) const;
};

// A struct that arrays are made of; `visit_members` names its members.
template <class T>
concept Record = requires(T& record) { visit_members(record, [](const char*, auto&) {}); };

// Elements of arrays: what NumPy calls them, and the buffer protocol.
struct Dtype {
    const char* name;
    const char* letters;  // formats of one letter
    std::size_t size;
    const char* record = nullptr;         // the name of a struct,
    const std::string* format = nullptr;  // which `check_record` has seen
    bool is(const Py_buffer& view) const;
};

template <class T> inline constexpr Dtype dtype_of{};
template <> inline constexpr Dtype dtype_of<double>{"float64", "d", 8};
template <> inline constexpr Dtype dtype_of<float>{"float32", "f", 4};
template <> inline constexpr Dtype dtype_of<bool>{"bool", "?", 1};
template <> inline constexpr Dtype dtype_of<i16>{"int16", "h", 2};
template <> inline constexpr Dtype dtype_of<i32>{"int32", "il", 4};
template <> inline constexpr Dtype dtype_of<i64>{"int64", "lq", 8};
template <> inline constexpr Dtype dtype_of<u8>{"uint8", "B", 1};
template <> inline constexpr Dtype dtype_of<u16>{"uint16", "H", 2};
template <> inline constexpr Dtype dtype_of<u32>{"uint32", "IL", 4};
template <> inline constexpr Dtype dtype_of<u64>{"uint64", "LQ", 8};

// What the buffer protocol calls the NumPy dtype of a record.
template <class T> inline std::string format_of;
template <Record T>
inline const Dtype dtype_of<T>{"record", "", sizeof(T), typeid(T).name(), &format_of<T>};

// A member of a record.
struct MemberAt {
    const char* name;
    i64 offset;
    std::size_t size;
    const char* type;
};

// Refuse a NumPy dtype that is not, member by member, the struct.
void check_members(
    nb::handle dtype, const std::vector<MemberAt>& members, const Dtype& record, std::string& format
);

template <Record T> COLD void check_record(nb::handle dtype) {
    T record{};
    std::vector<MemberAt> members;
    visit_members(record, [&]<class M>(const char* name, M& member) {
        i64 offset = reinterpret_cast<char*>(&member) - reinterpret_cast<char*>(&record);
        members.push_back({name, offset, sizeof(M), dtype_of<std::remove_all_extents_t<M>>.name});
    });
    check_members(dtype, members, dtype_of<T>, format_of<T>);
}

// Refuse a Python IntEnum that is not the enumeration; `visit_enumerators` names its members.
void check_enumerators(nb::handle given, const std::vector<std::pair<const char*, i64>>& wanted);

template <class E> COLD void check_enumeration(nb::handle given) {
    std::vector<std::pair<const char*, i64>> wanted;
    visit_enumerators(E{}, [&](const char* name, E value) {
        wanted.push_back({name, i64(value)});
    });
    check_enumerators(given, wanted);
}

// What an argument that is an array has to be.
struct ArrayKind {
    const Dtype& element;
    int rank;
    bool writes;

    std::string type() const;
    std::string wanted(const Where& where) const;
    nb::dict spec() const;
};

// The memory of an array, kept while a kernel works on it.
class Buffer {
public:
    Buffer() = default;
    // The array that `given` is: of the first kind that it fits, of all.
    Buffer(nb::handle given, const Where& where, Span<const ArrayKind> kinds);
    Buffer(Buffer&& other) noexcept
        : view_(other.view_), lengths_(other.lengths_), kind_(other.kind_) {
        other.view_.obj = nullptr;
    }
    Buffer& operator=(Buffer&& other) = delete;
    ~Buffer() {
        if (view_.obj) PyBuffer_Release(&view_);
    }
    bool is_taken() const { return view_.obj != nullptr; }
    template <class T> T* data() const { return static_cast<T*>(view_.buf); }
    i64 length(int axis) const { return lengths_[axis]; }
    std::size_t kind() const { return kind_; }

private:
    Py_buffer view_{};
    std::array<i64, 3> lengths_{};  // what the view says may be within itself, and stay behind
    std::size_t kind_ = 0;

    bool take(nb::handle value, const ArrayKind& kind);
    bool agrees(const Where& where) const;
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

template <View V>
inline constexpr ArrayKind kind_of{
    dtype_of<std::remove_const_t<typename ViewOf<V>::Element>>, ViewOf<V>::rank,
    !std::is_const_v<typename ViewOf<V>::Element>
};

// A struct of views and numbers that a kernel takes as one argument; `visit_arguments` names them.
template <class T>
concept Bundle = requires(T& bundle) { visit_arguments(bundle, [](const char*, auto&) {}); };

// Refuses, for the object of this name, what leads beyond an array: kernels follow indices.
struct IndexCheck {
    const char* object;
    void operator()(bool good, const char* what) const {
        if (!good) refuse(what);
    }
    [[noreturn]] void refuse(const char* what) const;
};

// What tests are told of an argument that is no array.
nb::dict spec_of_type(const std::string& type);

// Refuses what is no object of a class, or one that __new__ alone has made and that holds nothing.
void check_known(nb::handle given, nb::handle type, const Where& where);

// An object of a class that Python knows.
template <class T> struct KnownArgument {
    T* kept;
    COLD static std::string type() { return text_of(nb::type<T>().attr("__name__")); }
    COLD static nb::dict spec() { return spec_of_type(type()); }
    KnownArgument(nb::handle given, const Where& where) {
        check_known(given, nb::type<T>(), where);
        kept = nb::inst_ptr<T>(given);
    }
};

// How a Python value becomes an argument of a kernel, and what its type is called in a signature.
template <class T> struct Argument : KnownArgument<T> {
    using KnownArgument<T>::KnownArgument;
    T& get() { return *this->kept; }
};

template <View V> struct Argument<V> {
    Buffer buffer;

    static std::string type() { return kind_of<V>.type(); }
    static nb::dict spec() { return kind_of<V>.spec(); }
    Argument(nb::handle given, const Where& where) : buffer(given, where, {&kind_of<V>, 1}) {}
    V get() { return buffer.is_taken() ? ViewOf<V>::of(buffer) : V(); }
};

std::string type_of_choice(Span<const ArrayKind> kinds);
nb::dict spec_of_choice(Span<const ArrayKind> kinds);

// One of several kinds of view; the first that fits.
template <View... V> struct Argument<std::variant<V...>> {
    static constexpr std::array kinds{kind_of<V>...};
    Buffer buffer;

    static std::string type() { return type_of_choice(kinds); }
    static nb::dict spec() { return spec_of_choice(kinds); }
    Argument(nb::handle given, const Where& where) : buffer(given, where, kinds) {}
    std::variant<V...> get() {
        std::variant<V...> view;
        std::size_t kind = 0;
        if (buffer.is_taken())
            ((kind++ == buffer.kind() && (view = ViewOf<V>::of(buffer), true)) || ...);
        return view;
    }
};

template <> struct Argument<double> {
    double value;
    static std::string type() { return "float"; }
    static nb::dict spec() { return spec_of_type("float"); }
    Argument(nb::handle given, const Where& where);
    double get() { return value; }
};

template <> struct Argument<i64> {
    i64 value = 0;
    static std::string type() { return "int"; }
    static nb::dict spec() { return spec_of_type("int"); }
    Argument(nb::handle given, const Where& where);
    i64 get() { return value; }
};

template <> struct Argument<bool> {
    bool value;
    static std::string type() { return "bool"; }
    static nb::dict spec() { return spec_of_type("bool"); }
    Argument(nb::handle given, const Where& where);
    bool get() { return value; }
};

// A member of a bundle: an attribute of a value.
struct MemberArgument {
    std::string full;  // "?bundle.x[n]"
    Where where;
    nb::object value;

    MemberArgument(nb::handle given, const char* spelled, const Where& of);
};

void add_spec(nb::list& specs, nb::dict spec, const char* spelled);
nb::dict spec_of_members(const nb::list& members);

// The members of a bundle, taken one after the other from the attributes of a value.
template <Bundle B> class Bundled {
public:
    static std::string type() { return "Any"; }
    COLD static nb::dict spec() {
        nb::list members;
        B bundle{};
        visit_arguments(bundle, [&]<class T>(const char* spelled, T&) {
            using Plain = std::remove_const_t<std::remove_pointer_t<T>>;
            add_spec(members, Argument<Plain>::spec(), spelled);
        });
        return spec_of_members(members);
    }
    Bundled(nb::handle given, const Where& where) { fill(bundle_, given, where); }
    Bundled(const Bundled&) = delete;
    B& get() { return bundle_; }

private:
    B bundle_{};
    std::vector<Buffer> held_;
    std::vector<nb::object> known_;

    template <class M> void fill(M& record, nb::handle given, const Where& where) {
        visit_arguments(record, [&]<class T>(const char* spelled, T& member) {
            MemberArgument at(given, spelled, where);
            if constexpr (Bundle<T>) {
                fill(member, at.value, at.where);
            } else if constexpr (std::is_pointer_v<T>) {  // of a class that Python knows
                using Known = std::remove_const_t<std::remove_pointer_t<T>>;
                member = &Argument<Known>(at.value, at.where).get();
                known_.push_back(at.value);
            } else {
                Argument<T> argument(at.value, at.where);
                member = argument.get();
                if constexpr (requires { argument.buffer; })
                    held_.push_back(std::move(argument.buffer));
            }
        });
    }
};

template <Bundle B> struct Argument<B> : Bundled<B> {
    using Bundled<B>::Bundled;
};

// An array over memory that `owner` keeps.
nb::object array_over(
    void* data, const Dtype& element, std::initializer_list<std::size_t> shape, nb::handle owner
);

// An array of T that takes over the memory of a vector.
template <class T, class Made>
nb::object array_of(Made&& made, std::initializer_list<std::size_t> shape) {
    auto* kept = new Made(std::move(made));
    nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<Made*>(p); });
    return array_over(kept->data(), dtype_of<T>, shape, owner);
}

// How the result of a kernel becomes a Python value, and what its type is called.
template <class R> struct Result {
    static std::string type() {
        if constexpr (std::is_same_v<R, bool>) return "bool";
        else if constexpr (std::is_integral_v<R>) return "int";
        else if constexpr (std::is_floating_point_v<R>) return "float";
        else return "Any";
    }
    static nb::object of(R&& value) { return nb::cast(std::move(value)); }
};

template <> struct Result<void> {
    static std::string type() { return "None"; }
};

// Text comes as bytes.
template <> struct Result<std::string> {
    static std::string type() { return "bytes"; }
    static nb::object of(std::string&& text) { return nb::bytes(text.data(), text.size()); }
};

template <class T> struct Result<std::vector<T>> {
    static std::string type() { return kind_of<Span<T>>.type(); }
    static nb::object of(std::vector<T>&& made) {
        std::size_t size = made.size();
        return array_of<T>(std::move(made), {size});
    }
};

template <class T, std::size_t width> struct Result<std::vector<std::array<T, width>>> {
    static std::string type() { return kind_of<Matrix<T>>.type(); }
    static nb::object of(std::vector<std::array<T, width>>&& made) {
        std::size_t size = made.size();
        return array_of<T>(std::move(made), {size, width});
    }
};

// A record by itself becomes a dictionary; none of it None.
template <Record T> struct Result<T> {
    static std::string type() { return "dict[str, Any]"; }
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
        std::size_t bytes = made.size() * sizeof(T);
        return array_of<u8>(std::move(made), {bytes});
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

// A kernel as Python calls it, and what is said of its arguments and result.
struct ArgumentKind {
    std::string (*type)();
    nb::dict (*spec)();
};
struct Call {
    const char* function;
    const char* const* names;
    const nb::handle* given;
    Sizes sizes;

    Where where(std::size_t n) { return {function, names[n], sizes}; }
};
struct Kernel {
    Span<const ArgumentKind> arguments;
    std::string (*returned)();
    nb::object (*call)(Call&);
};

// Let Python call a kernel by this name.
void define(
    nb::module_& scope, const char* name, const char* doc,
    std::initializer_list<const char*> spelled, const Kernel& kernel
);

// The arguments of a call, taken in their order, in which letters of shapes are met: a tuple, but
// one that is quickly compiled.
template <std::size_t, class A> struct Slot {
    Argument<A> argument;
};
template <class Places, class... A> struct Slots;
template <std::size_t... I, class... A>
struct Slots<std::index_sequence<I...>, A...> : Slot<I, A>... {
    explicit Slots(Call& call) : Slot<I, A>{Argument<A>(call.given[I], call.where(I))}... {}
    template <auto kernel> decltype(auto) pass() {
        nb::gil_scoped_release free;
        return kernel(Slot<I, A>::argument.get()...);
    }
};

// The function that Python calls, from one in C++.
template <auto kernel, class R, class... A> struct Caller {
    static nb::object call(Call& from) {
        Slots<std::index_sequence_for<A...>, std::remove_cvref_t<A>...> slots(from);
        if constexpr (std::is_void_v<R>) {
            slots.template pass<kernel>();
            return nb::none();
        } else {
            return Result<R>::of(slots.template pass<kernel>());
        }
    }
    static constexpr std::array<ArgumentKind, sizeof...(A)> arguments{
        {{&Argument<std::remove_cvref_t<A>>::type, &Argument<std::remove_cvref_t<A>>::spec}...}
    };
    static constexpr Kernel made() { return {arguments, &Result<R>::type, &call}; }
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
    define(scope, name, doc, spelled, decltype(caller<kernel>(kernel))::made());
}

}  // namespace terratool::python
