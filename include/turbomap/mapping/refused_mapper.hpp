// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What is left of a local_mapper whose map_traits lack a required member: require_map_traits() has said which, and this takes any
/// call, so that the compiler has nothing to add.

#include "../config.hpp"
#include "local_mapper_options.hpp"
#include "mapping_report.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Stands for the adjustment of such a mapper.
struct refused_traits {};

class refused_mapper {
 public:
  template <class... Anything>
  explicit refused_mapper(const Anything&...) {}
  template <class... Anything>
  void insert(const Anything&...) {}
  template <class... Anything>
  void remove(const Anything&...) {}
  template <class... Anything>
  void watch(const Anything&...) {}
  template <class... Anything>
  void changed(const Anything&...) {}
  void refresh() {}
  void reset() {}
  template <class... Anything>
  const mapping_report& process(const Anything&...);
  template <class... Anything>
  void update_geometry(const Anything&...) {}
  template <class... Anything>
  void update_appearance(const Anything&...) {}
  const mapping_report& report() const;
  local_mapper_options& options();
};

}  // namespace detail

TURBOMAP_END_NAMESPACE
