// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Asks memory for the object behind the name of a point, as the user's map gives it. Objects in the field lie anywhere, and what
/// a mirror takes longest for is to wait for them.

#include <cstdint>
#include <memory>
#include <type_traits>

#include "../prefetch.hpp"

namespace turbomap {

namespace plain_detail {
/// Where the object of a name lies; 0 where nobody can say that without asking the name, which may be of what is gone: a handle
/// may throw then.
template <class Name>
std::uintptr_t address_of([[maybe_unused]] const Name& name) {
  if constexpr (std::is_pointer_v<Name>)
    return reinterpret_cast<std::uintptr_t>(name);
  else
    return 0;
}
template <class Object>
std::uintptr_t address_of(const std::shared_ptr<Object>& name) {
  return reinterpret_cast<std::uintptr_t>(name.get());
}
}  // namespace plain_detail

/// Asks for the first lines of the object; an object of a map is mostly a few lines long.
template <class Name>
void prefetch_named(const Name& name) {
  const std::uintptr_t object = plain_detail::address_of(name);
  // An object may end before: as numbers, since no pointer may be formed beyond its end.
  for (std::uintptr_t line = 0; object != 0 && line < 6; ++line)
    prefetch_line(reinterpret_cast<const void*>(object + 64 * line));  // NOLINT(performance-no-int-to-ptr)
}

}  // namespace turbomap
