// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What turbomap-bundle is asked to do, and the entry of each policy.

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace turbomap_bundle {

struct arguments {
  std::filesystem::path input, json;
  std::string format;  ///< bal, kitti-stereo, schur, lba, colmap, generated; empty: by content
  std::string policy = "seq";
  std::string solver = "automatic";   ///< automatic, dense, sparse, pcg
  std::string precision = "float64";  ///< float64, mixed, float32
  std::string kernel;                 ///< huber, none; empty: none for bal and generated, else huber
  int iterations = 10;
  std::string damping;      ///< identity, diagonal; empty: identity for lba, else diagonal
  double lambda_scale = 0;  ///< first damping, relative to the largest diagonal element, or to each; 0: 1e-5, 1e-4
  int repeat = 1;
  bool page_locked = false;               ///< what is adjusted lies in page-locked memory
  double perturb_m = 0, perturb_rad = 0;  ///< noise added to what is free, before the adjustment
  unsigned seed = 1;
  std::vector<double> camera;  ///< fx fy cx cy bf of a synthetic problem; empty: that of the recorded ones
};

/// The outcome of a run: its JSON, and whether every check held.
struct outcome {
  nlohmann::json json;
  bool good = true;
};

/// One run under the host policy that the arguments name, or under CUDA. The templates of every camera, solver and
/// precision are behind them, in run_host.cpp and, where there is CUDA, cuda/bundle_cuda.cu. run_cuda throws
/// std::runtime_error without a device.
outcome run_host(const arguments& arguments);
outcome run_cuda(const arguments& arguments);

}  // namespace turbomap_bundle
