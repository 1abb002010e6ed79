// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What turbomap-replay is asked to do, and the entry of each policy.

#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

namespace turbomap_replay {

struct arguments {
  std::filesystem::path recording;
  std::string policy = "seq";
  bool check = false;
  bool search = true, creation = true;     ///< stages that are switched on
  std::string candidates = "ordered";      ///< exhaustive, ordered or grouped (replay mode)
  std::filesystem::path json, trajectory;  ///< outputs; empty: none
  int repeat = 1;
};

/// The outcome of a run: its JSON, and whether every check held.
struct outcome {
  nlohmann::json json;
  bool good = true;
};

/// Implemented in cuda/replay_cuda.cu where there is CUDA. Throws std::runtime_error without a device.
outcome run_cuda(const arguments& arguments);

}  // namespace turbomap_replay
