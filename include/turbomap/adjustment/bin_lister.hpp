// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A counting sort: which items are in each bin.

#include <cstddef>
#include <cstdint>

#include "../plain_vector.hpp"

namespace turbomap {

/// Lists the items of each bin, in order, by a counting sort; items of bin -1 are in none.
class bin_lister {
 public:
  /// \param begin  [bin + 1] into list
  [[gnu::noinline]] void operator()(const plain_vector<std::int32_t>& bin, int bins, plain_vector<std::int32_t>& begin,
                                    plain_vector<std::int32_t>& list) {
    begin.assign(at(bins) + 1, 0);
    for (const auto b : bin)
      if (b >= 0) ++begin[at(b) + 1];
    for (std::size_t i = 1; i < begin.size(); ++i) begin[i] += begin[i - 1];
    list.resize(at(begin.back()));
    next_.assign(begin.begin(), begin.end());
    for (std::size_t i = 0; i < bin.size(); ++i)
      if (bin[i] >= 0) list[at(next_[at(bin[i])]++)] = static_cast<std::int32_t>(i);
  }

 private:
  static std::size_t at(std::int32_t i) { return static_cast<std::size_t>(i); }

  plain_vector<std::int32_t> next_;
};

}  // namespace turbomap
