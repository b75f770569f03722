// Keys of a JSON text, without reading the values behind them.
#pragma once

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

// Whether a key stands twice in one object of a JSON text, or there is a key with an escape, which
// may be another one that is spelled differently.
inline bool may_repeat_keys(Span<const u8> text) {
    std::vector<std::string_view> keys;  // of the objects that are open
    std::vector<std::size_t> begins;     // where those of each object begin
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
                if (escaped) return true;
                keys.emplace_back(characters + begin, std::size_t(length));
            }
        } else if (c == '{') {
            begins.push_back(keys.size());
        } else if (c == '}' && !begins.empty()) {
            if (has_equals(Span<std::string_view>(keys).subspan(begins.back()))) return true;
            keys.resize(begins.back());
            begins.pop_back();
        }
    }
    return false;
}

}  // namespace terratool::definition
