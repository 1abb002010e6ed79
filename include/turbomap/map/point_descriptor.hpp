// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The descriptor that map_traits give of a point, as elements that can be read.

#include "../config.hpp"
#include "../error.hpp"
#include "../traits.hpp"
#include "map_traits.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Where its elements are. \param given  by map_traits<Map>::descriptor_data(): must live as long as they are read
/// \throws std::invalid_argument  the point has none, or too few elements
template <class Map, class Given>
const auto* point_descriptor(const Map& map, const typename map_traits<Map>::point& point, const Given& given) {
  const auto* const elements = elements_of<typename map_traits<Map>::descriptor>(given);
  if (elements == nullptr)
    reject("point without descriptor_data", map_traits<Map>::id(map, point), "there is a descriptor for every point");
  return elements;
}

}  // namespace detail

TURBOMAP_END_NAMESPACE
