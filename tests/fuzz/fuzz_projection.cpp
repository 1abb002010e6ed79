// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The duplicate search, the search by projection and the appearance of points, on hostile points and keyframes.

#include <turbomap/descriptor/binary.hpp>

#include "hostile.hpp"
#include "projection_problem.hpp"

using namespace turbomap_fuzz;

namespace {

template <class Camera>
void run(const turbomap_test::test_rig<Camera>& rig, choices& c) {
  projection_problem<turbomap::binary_descriptor<256>, Camera>(rig, c).run(c);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  const unsigned rig = c.byte() % 4;
  if (rig < 2)
    run(turbomap_test::pinhole_rig(rig == 0 ? 0 : 50), c);
  else
    run(turbomap_test::fisheye_rig(static_cast<int>(rig)), c);
  return 0;
}
