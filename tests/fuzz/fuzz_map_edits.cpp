// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Edits, merges, commits and culling of a map, in any order and on any operands, dead ones too, against the oracle of a map.

#include <vector>

#include "hostile.hpp"
#include "scenes/map_world.hpp"

using namespace turbomap_fuzz;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  turbomap_test::world_options options;
  options.cameras = 1 + static_cast<int>(c.below(2)), options.levels = 1 + static_cast<int>(c.below(8));
  options.keypoints_per_camera = 1 + static_cast<int>(c.below(24));
  std::vector<turbomap_test::edit> edits;
  constexpr std::size_t kinds = static_cast<std::size_t>(turbomap_test::edit_kind::forget_replacements) + 1;
  while (!c.empty()) {
    const auto kind = static_cast<turbomap_test::edit_kind>(c.below(kinds));
    const unsigned a = c.word(), b = c.byte();
    edits.push_back({kind, a, b, c.byte()});
  }
  const auto failure = turbomap_test::run_edits<turbomap_test::flat_map>(edits, options, 64);
  if (failure) fail("edit " + std::to_string(failure->edit) + ": " + failure->what);
  return 0;
}
