// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The processor that figures were measured on, and what the program was compiled by and for.

#include <fstream>
#include <string>

#include <turbomap/config.hpp>

namespace turbomap_bench {

/// "model name" of /proc/cpuinfo, or "unknown".
inline std::string processor_name() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);)
    if (line.rfind("model name", 0) == 0 && line.find(": ") != std::string::npos)
      return line.substr(line.find(": ") + 2);
  return "unknown";
}

#define TURBOMAP_BENCH_TEXT(name) #name
#define TURBOMAP_BENCH_NAME_OF(name) TURBOMAP_BENCH_TEXT(name)
/// The host compiler, and the library's namespace, which names the vector instructions, e.g. "g++ 12.2.0, host_avx2".
inline std::string compiled() {
#if defined(__clang__)
  const std::string compiler = std::string("clang++ ") + __clang_version__;
#else
  const std::string compiler = std::string("g++ ") + __VERSION__;
#endif
  return compiler + ", " + TURBOMAP_BENCH_NAME_OF(TURBOMAP_ABI);
}
#undef TURBOMAP_BENCH_NAME_OF
#undef TURBOMAP_BENCH_TEXT

}  // namespace turbomap_bench
