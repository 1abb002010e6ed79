// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The option --json of programs: their result as a file.

#include <filesystem>
#include <fstream>
#include <stdexcept>

#include <nlohmann/json.hpp>

namespace turbomap_program {

/// Nothing where no file is named. Throws std::runtime_error when it cannot be written.
inline void write_json(const std::filesystem::path& path, const nlohmann::json& json) {
  if (path.empty()) return;
  std::ofstream file(path);
  file << json.dump(2) << '\n';
  if (!file.flush()) throw std::runtime_error(path.string() + ": cannot be written");
}

}  // namespace turbomap_program
