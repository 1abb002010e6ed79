// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How much memory a long run uses.

#include <fstream>

#ifdef __linux__
#include <unistd.h>
#endif

namespace turbomap_test {

/// Memory of this process that is in use, in MB; 0 where it cannot be asked for.
inline double resident_mb() {
#ifdef __linux__
  std::ifstream file("/proc/self/statm");
  double all = 0, resident = 0;
  file >> all >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20);
#else
  return 0;
#endif
}

}  // namespace turbomap_test
