// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A local mapper that is compiled in one file (instantiated.cpp): every other file that uses it compiles in a fraction of the
/// time.

#include <thrust/execution_policy.h>

#include <turbomap/camera/pinhole.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/local_mapper.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>

namespace my {

using orb = turbomap::binary_descriptor<256>;
using camera = turbomap::pinhole<float>;
using map_type = turbomap::simple_map<orb, camera>;
using policy = std::decay_t<decltype(thrust::host)>;
using mapper_type = turbomap::local_mapper<map_type, policy>;

}  // namespace my

extern template class turbomap::local_mapper<my::map_type, my::policy>;
