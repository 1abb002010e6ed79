// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A user with .cpp and .cu files in one program. This one knows types, options and plans, and drives a mapper on the
/// host and one on a device; both must give the same plans. Ends with 77 where there is no device.

#include "mixed.hpp"

#include <cstdio>

#if defined(CUDART_VERSION) || TURBOMAP_HAS_CUDA
#error "a .cpp of the mixed user sees CUDA"
#endif

int main() {
  const auto frames = my::make_frames();
  const my::plans host = my::map_on_host(frames);
  if (!my::plausible(host)) return 1;
  if (!my::device_mapper::available()) {
    std::printf("skipped: no CUDA device\n");
    return 77;
  }
  my::device_mapper device;
  for (const my::frame& f : frames) device.insert(f);
  return my::equal(device.map(), host) && my::equal(device.map(), host) ? 0 : 1;
}
