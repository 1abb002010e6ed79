// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The search and what follows it with descriptors of real numbers: of floats, some of them huge or no numbers at all,
// and of bytes. What has no finite distance matches nothing.

#include <turbomap/descriptor/real.hpp>

#include "hostile.hpp"
#include "matching_problem.hpp"

using namespace turbomap_fuzz;

namespace {

template <class Descriptor, class Camera>
void run(const turbomap_test::test_rig<Camera>& rig, choices& c) {
  matching_problem<Descriptor, Camera>(rig, c).run(c);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  if (c.flag())
    run<turbomap::real_descriptor<float, 20>>(turbomap_test::fisheye_rig(1 + static_cast<int>(c.below(2))), c);
  else
    run<turbomap::real_descriptor<std::int8_t, 16>>(turbomap_test::pinhole_rig(c.flag() ? 0 : 50), c);
  return 0;
}
