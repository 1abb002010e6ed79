// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What the two halves of the mixed user share: plain data only.

#include <turbomap/types.hpp>

turbomap::vec3<double> transform_in_cu(const turbomap::rigid_transform<double>& pose, turbomap::vec3<double> x);
bool compiled_for_cuda();
