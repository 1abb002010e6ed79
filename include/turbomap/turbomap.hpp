// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// All of the library but io/ (files) and interop/ (other libraries' types), which bring dependencies of their own. Each
/// header also stands alone: include what you use where compile time matters.

#include "array.hpp"
#include "camera/any_camera.hpp"
#include "camera/brown_conrady.hpp"
#include "camera/double_sphere.hpp"
#include "camera/kannala_brandt.hpp"
#include "camera/pinhole.hpp"
#include "camera/rig.hpp"
#include "config.hpp"
#include "context.hpp"
#include "descriptor/binary.hpp"
#include "descriptor/descriptor_concept.hpp"
#include "descriptor/real.hpp"
#include "error.hpp"
#include "map/simple_map.hpp"
#include "matching/correspondence_search.hpp"
#include "matching/filters.hpp"
#include "matching/given_correspondences.hpp"
#include "matching/neighbour_rules.hpp"
#include "matching/point_creation.hpp"
#include "math/functions.hpp"
#include "math/linear.hpp"
#include "math/strict.hpp"
#include "span.hpp"
#include "store/keyframe_store.hpp"
#include "traits.hpp"
#include "types.hpp"
