// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Search, filters, tracks and creation of points on hostile keyframes: any pixels, equal descriptors, the query as its
// own neighbour, the same neighbour twice, rigs. The ordered search must find what the exhaustive one finds.

#include <turbomap/descriptor/binary.hpp>

#include "hostile.hpp"
#include "matching_problem.hpp"

using namespace turbomap_fuzz;

namespace {

template <class Camera>
void run(const turbomap_test::test_rig<Camera>& rig, choices& c) {
  matching_problem<turbomap::binary_descriptor<256>, Camera>(rig, c).run(c);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  const unsigned rig = c.byte() % 5;
  if (rig < 2)
    run(turbomap_test::pinhole_rig(rig == 0 ? 0 : 50), c);
  else
    run(turbomap_test::fisheye_rig(static_cast<int>(rig) - 1), c);
  return 0;
}
