// Keys of a JSON text, without reading the values behind them.
#pragma once

#include <array>
#include <string_view>

#include "../core.hpp"

namespace terratool::definition {

constexpr i64 FEW = 16;  // keys of an object that are compared all with all

// Whether any two of `keys` are the same; sorts them.
inline bool has_equals(Span<std::string_view> keys) {
    if (count_of(keys) > FEW) {
        std::sort(keys.begin(), keys.end());
        return std::adjacent_find(keys.begin(), keys.end()) != keys.end();
    }
    for (std::size_t later = 1; later < keys.size(); ++later)
        for (std::size_t k = 0; k < later; ++k)
            if (keys[k] == keys[later]) return true;
    return false;
}

constexpr i64 SHELVES = 4096;  // sets of keys that are told apart

// The set that a key is in.
inline std::size_t shelf_of(std::string_view key) {
    if (key.empty()) return 0;
    u64 mixed = u8(key.front()) + 5 * u8(key[key.size() / 2]) + 29 * u8(key.back());
    return (mixed + 131 * key.size()) % SHELVES;
}

// Whether a key stands twice in one object of a JSON text, or there is a key with an escape, which
// may be another one that is spelled differently.
//
// Of `names`, each with a line feed behind it, those that may be keys are marked in `present`: if
// there is an escape all of them.
inline bool survey_keys(Span<const u8> text, Span<const u8> names, Span<u8> present) {
    struct Object {
        std::size_t begin;   // where its keys begin
        u64 sets = 0;        // of its keys, 64 of them
        bool close = false;  // whether two keys are in the same set
    };
    std::vector<std::string_view> keys;  // of the objects that are open
    std::vector<Object> objects;
    std::array<u8, SHELVES> seen{};
    bool repeated = false;
    auto mark_present = [&] {
        const char* name = reinterpret_cast<const char*>(names.data());
        std::string_view left(name, names.size());
        for (u8& mark : present) {
            std::size_t length = std::min(left.find('\n'), left.size());
            mark = seen[shelf_of(left.substr(0, length))];
            left.remove_prefix(std::min(length + 1, left.size()));
        }
    };
    const char* characters = reinterpret_cast<const char*>(text.data());
    i64 end = count_of(text), at = 0;
    auto is_space = [&](i64 k) {
        return text[k] == ' ' || text[k] == '\n' || text[k] == '\r' || text[k] == '\t';
    };
    while (at < end) {
        u8 c = text[at++];
        if (c == '"') {
            i64 begin = at;
            bool escaped = false;
            for (; at < end && text[at] != '"'; ++at)
                if (text[at] == '\\') {
                    escaped = true;
                    ++at;
                }
            i64 length = at - begin;
            for (++at; at < end && is_space(at);) ++at;
            if (at < end && text[at] == ':') {
                if (escaped) {
                    std::fill(present.begin(), present.end(), u8(1));
                    return true;
                }
                keys.emplace_back(characters + begin, std::size_t(length));
                std::size_t shelf = shelf_of(keys.back());
                seen[shelf] = 1;
                if (!objects.empty()) {
                    u64 set = u64(1) << (shelf * 0x9E3779B97F4A7C15u >> 58);
                    objects.back().close |= (objects.back().sets & set) != 0;
                    objects.back().sets |= set;
                }
            }
        } else if (c == '{') {
            objects.push_back({keys.size()});
        } else if (c == '}' && !objects.empty()) {
            auto [begin, sets, close] = objects.back();
            repeated |= close && has_equals(Span<std::string_view>(keys).subspan(begin));
            keys.resize(begin);
            objects.pop_back();
        }
    }
    mark_present();
    return repeated;
}

}  // namespace terratool::definition
