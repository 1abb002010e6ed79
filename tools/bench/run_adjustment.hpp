// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The adjustments that a recording holds, timed by units of their own: adjustment_stages.hpp under each policy.

#include <nlohmann/json.hpp>

#include <turbomap/io/recording.hpp>

#include "measure.hpp"

namespace turbomap_bench {

nlohmann::json run_adjustments_on_host(const turbomap::recording& recording, const arguments& a);

/// Implemented in cuda/bench_adjustment.cu where there is CUDA. Throws std::runtime_error without a device.
nlohmann::json run_adjustments_on_device(const turbomap::recording& recording, const arguments& a);

}  // namespace turbomap_bench
