// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How the user names a keyframe of the store.

#include <cstdint>
#include <type_traits>

namespace turbomap {

/// Names one keyframe of one store. Slots are used again, generations are not: a handle that outlived its keyframe
/// never means another one. A value-initialised handle names nothing.
struct keyframe_handle {
  std::uint32_t slot = 0xFFFFFFFFu;  ///< its place in the store; the default names none.
  std::uint32_t generation = 0;      ///< from 1 on in handles of a store

  /// Whether both name the same keyframe.
  friend constexpr bool operator==(keyframe_handle a, keyframe_handle b) {
    return a.slot == b.slot && a.generation == b.generation;
  }
  /// Whether they name two.
  friend constexpr bool operator!=(keyframe_handle a, keyframe_handle b) { return !(a == b); }
};

static_assert(std::is_trivially_copyable_v<keyframe_handle> && sizeof(keyframe_handle) == 8);

}  // namespace turbomap
