// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The option --json of programs: their result as a file.

#include <filesystem>
#include <stdexcept>
#include <string>

#include <nlohmann/json.hpp>

#include <turbomap/io/file_handle.hpp>

namespace turbomap_program {

/// Nothing where no file is named. Bytes of names that are not UTF-8 become U+FFFD. Throws std::runtime_error when it cannot be
/// written, and what was there stays.
inline void write_json(const std::filesystem::path& path, const nlohmann::json& json) {
  if (path.empty()) return;
  const std::string text = json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + '\n';
  if (!turbomap::detail::replace_text_file(path, text)) throw std::runtime_error(path.string() + ": cannot be written");
}

}  // namespace turbomap_program
