// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The tests of camera/any_camera.hpp under nvcc: device against host as well.

#include "test_camera_any.cpp"
