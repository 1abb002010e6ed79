// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The lists of an adjustment_structure where the policy computes.

#include "../config.hpp"
#include "structure.hpp"
#include "uploaded.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The lists of one problem.
template <class Memory>
class resident_structure {
 public:
  /// Empty. \param resource  memory of the policy; must outlive this
  explicit resident_structure(std::pmr::memory_resource* resource) {
    const auto use_resource = [resource](auto& list, auto&) { list = std::decay_t<decltype(list)>(resource); };
    for_each_sum_list(sums_, sums_, use_resource);
    for_each_block_list(blocks_, blocks_, use_resource);
  }

  /// All but the lists of blocks. The structure must stay as it is while it is read.
  template <class Policy>
  void send_sums(const Policy& policy, const adjustment_structure& s) {
    for_each_sum_list(sums_, s, [&](auto& list, const auto& host) { list.send(policy, host); });
  }
  /// The lists of blocks.
  template <class Policy>
  void send_blocks(const Policy& policy, const adjustment_structure& s) {
    for_each_block_list(blocks_, s, [&](auto& list, const auto& host) { list.send(policy, host); });
  }

  /// Fills in the pointers of a view, e.g. schur_view. Those of the blocks are null before send_blocks().
  template <class View>
  void point(View& view) const {
    const auto to_data = [](auto& pointer, const auto& list) { pointer = list.data(); };
    for_each_sum_list(view, sums_, to_data);
    for_each_block_list(view, blocks_, to_data);
  }

 private:
  template <class T>
  using list = resident_copy<T, Memory>;

  sum_lists<list> sums_;
  block_lists<list> blocks_;
};

TURBOMAP_END_NAMESPACE
