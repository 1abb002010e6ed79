// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A mapper behind a wall: what it computes with is known to its own source file only, so that .cpp files drive a
/// device without a CUDA header.

#include <memory>

#include "plans.hpp"

namespace my {

/// In mixed.cu, under CUDA.
class device_mapper {
 public:
  static bool available();  ///< there is a device
  device_mapper();
  ~device_mapper();
  void insert(const frame& f);
  plans map();

 private:
  struct implementation;
  std::unique_ptr<implementation> implementation_;
};

/// In mixed_host.cpp, under thrust::seq.
plans map_on_host(const std::vector<frame>& frames);

}  // namespace my
