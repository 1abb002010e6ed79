// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// All numbers of a recording, as bytes: two recordings are the same when they are.

#include <string>

#include <turbomap/io/recording.hpp>

namespace turbomap_fuzz {

inline std::string contents(const turbomap::recording& r) {
  std::string all;
  turbomap::visit_arrays(r, [&](const char* name, const auto& rows, turbomap::recording_rows, turbomap::presence) {
    all.append(name).append(std::to_string(rows.size()));
    all.append(reinterpret_cast<const char*>(rows.data()), rows.size() * sizeof(*rows.data()));
  });
  return all;
}

}  // namespace turbomap_fuzz
