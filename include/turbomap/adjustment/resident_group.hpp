// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a problem keeps of a factor group (factors.hpp): checked, in the order of the structure, where the policy computes.
/// A specialisation per kind of group: resident_reprojections.hpp, resident_factors.hpp.

#include <cstdint>

#include "../config.hpp"
#include "../error.hpp"
#include "../math/number_checks.hpp"
#include "../parallel.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "factor_sums.hpp"
#include "order_observations.hpp"
#include "robust.hpp"
#include "structure.hpp"
#include "structure_input.hpp"
#include "uploaded.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Members of each specialisation:
///
///     static constexpr bool with_landmarks;
///     static constexpr bool own_landmark_factors;      // with landmarks, and not reprojections
///     static constexpr bool reprojects;                // reprojections
///     static void check(group, frames, landmarks);     // throws std::invalid_argument
///     static bool all_finite(group);                   // whether all numbers are
///     void describe(group, structure_inputs&);         // adds what the structure must know
///     void assign(policy, group, structure, place);    // takes the group; moves `place` to the next one's
///     template <class G> void linearise(policy, estimate, factor_sums, cost_sums) const;  // G: numbers of
///                                                      // residuals; cost_sums of null pointers: not asked for
///     template <class G> void cost(policy, estimate, cost_sums) const;
///     void chi2(policy, estimate, chi2, depth) const;  // groups with landmarks, per entry
template <class Group, class Frame, class Memory>
class resident_group;

/// What the structure needs to know of all groups, in their order.
struct structure_inputs {
  plain_vector<landmark_group_input> landmark_groups;  ///< groups with landmarks
  plain_vector<frame_group_input> frame_groups;        ///< groups of factors of frames
};

/// The part of a group_structure that groups with landmarks read where the policy computes.
template <class Memory>
class resident_entries {
 public:
  /// Empty. \param r  memory of the policy; must outlive this
  explicit resident_entries(std::pmr::memory_resource* r)
      : chunks_(r), source_(r), landmark_(r), row_(r), coupling_(r) {}

  /// Sends the arrays of a group. Enqueued; `s` must stay until it has passed.
  template <class Policy>
  void send(const Policy& policy, const group_structure& s) {
    chunks_.send(policy, s.chunks), landmark_.send(policy, s.landmark);
    row_.send(policy, s.row), coupling_.send(policy, s.coupling), source_.send(policy, s.source);
    chunk_count_ = static_cast<int>(s.chunks.size()), size_ = s.source.size();
  }
  /// Room for lists that the policy makes. \param to  where
  void make(std::size_t most_chunks, observation_lists& to) {
    const std::size_t entries = most_chunks * observation_padding;
    to.chunks = chunks_.make(most_chunks), to.source = source_.make(entries);
    to.entry_landmark = landmark_.make(entries), to.row = row_.make(entries), to.coupling = coupling_.make(entries);
  }
  /// How many chunks the policy made.
  void made(int chunks) {
    chunk_count_ = chunks;
    size_ = static_cast<std::size_t>(chunks) * observation_padding;
  }
  /// Enqueues copies of lists that the policy made.
  template <class Policy>
  void fetch(const Policy& policy, group_structure& to) const {
    const auto chunks = static_cast<std::size_t>(chunk_count_), entries = size_;
    fetch_list(policy, chunks_, chunks, to.chunks), fetch_list(policy, source_, entries, to.source);
    fetch_list(policy, landmark_, entries, to.landmark), fetch_list(policy, row_, entries, to.row);
    fetch_list(policy, coupling_, entries, to.coupling);
  }

  /// How many chunks.
  int chunk_count() const { return chunk_count_; }
  /// Entries, padding too.
  std::size_t size() const { return size_; }
  /// Where the policy computes.
  const observation_chunk* chunks() const { return chunks_.data(); }
  /// [entry] row of the caller, where the policy computes.
  const std::int32_t* source() const { return source_.data(); }

  /// Fills in the pointers of a view of a group.
  template <class View>
  void point(View& view) const {
    view.chunks = chunks_.data(), view.landmark = landmark_.data();
    view.row = row_.data(), view.coupling = coupling_.data();
    view.chunk_count = chunk_count_;
  }

 private:
  resident_copy<observation_chunk, Memory> chunks_;
  resident_copy<std::int32_t, Memory> source_, landmark_, row_, coupling_;
  int chunk_count_ = 0;
  std::size_t size_ = 0;
};

/// Index = chunk: values of its entries in the order of the rows that were given.
struct return_rows {
  const observation_chunk* chunks;  ///< of the group
  const std::int32_t* source;       ///< [entry]
  const double* chi2;               ///< [entry]
  const double* depth;              ///< [entry]
  double* chi2_of_row;              ///< [row]
  double* depth_of_row;             ///< [row]

  /// Entries of a chunk.
  TURBOMAP_HD void operator()(int chunk) const {
    const observation_chunk& c = chunks[chunk];
    for (int i = c.begin; i < c.begin + c.count; ++i)
      chi2_of_row[source[i]] = chi2[i], depth_of_row[source[i]] = depth[i];
  }
};

/// \param to  chi2, then depth, of `rows` rows  \param values  the same of `n` entries
template <class Derived, class Memory>
void launch_return_rows(const thrust::execution_policy<Derived>& policy, const resident_entries<Memory>& entries,
                        const double* values, std::size_t n, double* to, std::size_t rows) {
  for_each_index(derived(policy), entries.chunk_count(),
                 return_rows{entries.chunks(), entries.source(), values, values + n, to, to + rows});
}

namespace detail {

inline void require_indices(span<const std::int32_t> index, int end, const char* name) {
  // The sign of either is set where one is outside. No comparison in the loop: they are rarely wrong.
  const auto last = static_cast<std::uint32_t>(end) - 1;
  std::uint32_t signs = 0;
  for (const auto i : index) signs |= static_cast<std::uint32_t>(i) | (last - static_cast<std::uint32_t>(i));
  if (signs >> 31 == 0) return;
  for (const auto i : index) require(i >= 0 && i < end, name, i, "is no such frame or landmark");
}

/// What a kernel must give, whatever it is: cost and weight of any error.
template <class Kernel>
void require_kernel(const Kernel& kernel, const char* argument) {
  for (const double chi2 : {0.0, 1.0, 1e6}) {
    double rho = 0, weight = 0;
    kernel(chi2, rho, weight);
    require(is_finite(rho), argument, rho, "must give a finite cost");
    require(is_finite(weight) && weight >= 0, argument, weight, "must give a finite weight that is not negative");
  }
}
inline void require_kernel(const no_kernel&, const char*) {}
inline void require_kernel(const huber& kernel, const char* argument) {
  require(kernel.delta2 > 0 && is_finite(kernel.delta2), argument, kernel.delta2, "delta2 must be finite and positive");
}
inline void require_kernel(const cauchy& kernel, const char* argument) {
  require(kernel.c2 > 0 && is_finite(kernel.c2), argument, kernel.c2, "c2 must be finite and positive");
}
inline void require_kernel(const tukey& kernel, const char* argument) {
  require(kernel.c2 > 0 && is_finite(kernel.c2), argument, kernel.c2, "c2 must be finite and positive");
}
/// Of rows that are not defined.
inline void require_undefined_chi2(double chi2) { check_not_negative("undefined_chi2", chi2); }

}  // namespace detail

TURBOMAP_END_NAMESPACE
