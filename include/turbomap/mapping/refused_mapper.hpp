// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What is left of a local_mapper whose map_traits lack a required member: require_map_traits() has said which, and this takes any
/// call, so that the compiler has nothing to add.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "handle_table.hpp"
#include "local_mapper_options.hpp"
#include "mapping_report.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Stands for the adjustment of such a mapper.
struct refused_traits {};

/// Takes what is given for an argument, braces too.
struct any_argument {
  template <class... Anything>
  any_argument(const Anything&...) {}  // NOLINT(google-explicit-constructor)
};

class refused_mapper {
 public:
  template <class... Anything>
  explicit refused_mapper(const Anything&...) {}
  void insert(const any_argument&, const any_argument&) {}
  void remove(const any_argument&) {}
  void watch(const any_argument&) {}
  void changed(const any_argument&) {}
  void refresh() {}
  void reset() {}
  const mapping_report& process(const any_argument&);
  local_adjustment_summary adjust_globally(const any_argument&, const any_argument&);
  fusion_summary fuse_around(const any_argument&);
  void update_geometry(const any_argument&) {}
  void update_appearance(const any_argument&) {}
  const mapping_report& report() const;
  local_mapper_options& options();
  std::int64_t iterations() const;
  const refused_mapper& last_search() const;
  const handle_table& stored() const;

  // Of the last search.
  std::size_t neighbour_count() const;
  bool stopped() const;
};

}  // namespace detail

TURBOMAP_END_NAMESPACE
