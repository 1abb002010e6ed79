// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Keys of a JSON file, strictly: a number that has no room in its type is refused, not bent.

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include <nlohmann/json.hpp>

#include "../config.hpp"
#include "../error.hpp"
#include "../types.hpp"
#include "text_file.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Reads keys of a JSON object with messages that name file, key and reason. An integer is one that T holds, written
/// without a point; a real number is finite in T.
class json_reader {
 public:
  explicit json_reader(const std::filesystem::path& file) : json_reader(file, read_text_file(file)) {}
  /// Of a text that is not in a file, or not yet.
  json_reader(const std::filesystem::path& file, const std::string& text) : file_(file) {
    json_ = nlohmann::json::parse(text, nullptr, false);
    if (json_.is_discarded() || !json_.is_object()) fail("", "is not a JSON object");
  }
  [[noreturn]] void fail(const std::string& key, const std::string& reason) const {
    throw bad_file("turbomap: " + file_.string() + ": " + (key.empty() ? "" : "key '" + key + "': ") + reason);
  }
  const nlohmann::json& json() const { return json_; }
  bool has(const char* key) const { return json_.contains(key) && !json_[key].is_null(); }

  template <class T>
  T get(const char* key) const {
    if (!has(key)) fail(key, "is missing");
    return convert<T>(key, json_[key]);
  }
  template <class T>
  T get(const char* key, const T& otherwise) const {
    return has(key) ? convert<T>(key, json_[key]) : otherwise;
  }
  rigid_transform<float> pose(const char* key) const {
    const auto v = get<std::vector<float>>(key, {0, 0, 0, 1, 0, 0, 0});
    if (v.size() != 7) fail(key, "has " + std::to_string(v.size()) + " numbers, not qx qy qz qw tx ty tz");
    return {v[0], v[1], v[2], v[3], v[4], v[5], v[6]};
  }
  /// A member of an object inside `key`; `otherwise`, where given, when it is not there.
  template <class T>
  T member(const char* key, const nlohmann::json& object, const char* name, const T* otherwise = nullptr) const {
    const std::string where = std::string(key) + "." + name;
    const auto found = object.find(name);
    if (found != object.end()) return convert<T>(where, *found);
    if (otherwise == nullptr) fail(where, "is missing");
    return *otherwise;
  }

 private:
  template <class T>
  struct is_vector : std::false_type {};
  template <class T>
  struct is_vector<std::vector<T>> : std::true_type {};

  template <class T>
  T convert(const std::string& key, const nlohmann::json& value) const {
    if constexpr (is_vector<T>::value) {
      if (!value.is_array()) fail(key, "has the wrong type, it is no list");
      T list;
      list.reserve(value.size());
      for (const auto& element : value) list.push_back(convert<typename T::value_type>(key, element));
      return list;
    } else if constexpr (std::is_same_v<T, std::string>) {
      if (!value.is_string()) fail(key, "has the wrong type, it is no string");
      return value.get<std::string>();
    } else if constexpr (std::is_integral_v<T>) {
      static_assert(std::is_signed_v<T>);
      if (!value.is_number_integer()) fail(key, "has the wrong type, it is no integer");
      const bool fits = value.is_number_unsigned()  // 0 and above are kept as unsigned
                            ? value.get<std::uint64_t>() <= static_cast<std::uint64_t>(std::numeric_limits<T>::max())
                            : value.get<std::int64_t>() >= std::numeric_limits<T>::min();
      if (!fits) fail(key, "is out of range");
      return value.get<T>();
    } else {
      static_assert(std::is_floating_point_v<T>);
      if (!value.is_number()) fail(key, "has the wrong type, it is no number");
      const auto number = value.get<double>();
      if (!(std::abs(number) <= static_cast<double>(std::numeric_limits<T>::max()))) fail(key, "is out of range");
      return static_cast<T>(number);
    }
  }

  std::filesystem::path file_;
  nlohmann::json json_;
};

}  // namespace detail

TURBOMAP_END_NAMESPACE
