// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Points in keyframes of cameras that no lens is like: every model, mixed in one rig, with any parameters that
// validate() lets pass, and a user's own model that has none of the optional members.

#include <turbomap/descriptor/binary.hpp>

#include "hostile.hpp"
#include "hostile_cameras.hpp"
#include "projection_problem.hpp"

using namespace turbomap_fuzz;

namespace {

template <class Camera>
void run(turbomap_test::test_rig<Camera> rig, choices& c) {
  if (!bend(rig, static_cast<lens>(c.below(3)), c)) return;
  projection_problem<turbomap::binary_descriptor<256>, Camera>(rig, c).run(c);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  return run_on_models(c, 8, [&](const auto& rig) { run(rig, c); });
}
