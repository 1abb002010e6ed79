// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Preintegration of many intervals in one call under any policy, each by one thread; and of one on the host.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "../array.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "../math/number_checks.hpp"
#include "../parallel.hpp"
#include "../span.hpp"
#include "imu_check.hpp"
#include "integrate_interval.hpp"
#include "preintegration.hpp"
#include "preintegration_options.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The preintegrations of one call, where they were computed. Make one and use it for every call: its memory is reused.
/// Move-only; not shared between threads.
template <class S, class Policy>
class preintegrations {
 public:
  using memory_type = memory_of_t<Policy>;  ///< where the results stay

  /// None. \param ctx  its resource gives the memory, and must outlive this
  explicit preintegrations(const context<Policy>& ctx) : inputs_(ctx.resource()), values_(ctx.resource()) {}

  /// In the memory of the policy, in the order of the intervals; work enqueued later in the same context may read them.
  span<const preintegration<S>> resident() const { return {values_.data(), values_.size()}; }
  /// The same on the host. Waits. O(intervals).
  void values(context<Policy>& ctx, std::vector<preintegration<S>>& result) const {
    result.resize(values_.size());
    copy_out(ctx.policy(), result.data(), values_.data(), result.size() * sizeof(preintegration<S>));
    ctx.synchronize();
  }
  /// The same as a new list.
  std::vector<preintegration<S>> values(context<Policy>& ctx) const {
    std::vector<preintegration<S>> result;
    values(ctx, result);
    return result;
  }

  /// \name For preintegrate(), which fills them
  /// @{
  /// Where the arguments of a call are sent.
  array<std::byte, memory_type>& inputs() { return inputs_; }
  /// Room for the results; what was there is lost.
  preintegration<S>* make_room(std::size_t intervals) {
    values_.resize_discard(intervals);
    return values_.data();
  }
  /// @}

 private:
  array<std::byte, memory_type> inputs_;
  array<preintegration<S>, memory_type> values_;
};

namespace detail {

/// Index = interval.
template <class S>
struct preintegrate_one {
  const std::int64_t* t_ns;
  const imu_sample* sample;
  const imu_interval* interval;
  const imu_bias<S>* bias;
  preintegration_options options;
  preintegration<S>* result;

  TURBOMAP_HD void operator()(int i) const {
    result[i] = integrate_interval(t_ns, sample, interval[i], bias[i], options);
  }
};

}  // namespace detail

/// Integrates each interval by one thread. O(samples of the longest interval) under a device.
template <class Derived, class S>
void launch_preintegrate(const thrust::execution_policy<Derived>& policy, int intervals,
                         const detail::preintegrate_one<S>& work) {
  for_each_index(derived(policy), intervals, work);
}

/// Integrates every interval at its bias [Forster et al. 2017]: motion, derivatives by the bias, covariance.
/// \param samples    of one IMU; times increase within each interval
/// \param intervals  may overlap, in any order, with their samples (find_interval())
/// \param biases     one per interval
/// \param result     overwritten. Under CUDA the work may still be running on return
/// \throws std::invalid_argument  sizes, options, or the data of an interval: times that do not increase, a gap above
///                                options.max_gap, samples that do not reach its ends, NaN, saturated values. Nothing
///                                is changed
/// Cost: O(samples of all intervals), about 1.5 us per sample on a CPU core.
template <class S, class Policy>
void preintegrate(context<Policy>& ctx, const imu_samples& samples, span<const imu_interval> intervals,
                  span<const imu_bias<S>> biases, const preintegration_options& options,
                  preintegrations<S, Policy>& result) {
  detail::check_preintegration_options(options);
  require(biases.size() == intervals.size(), "biases.size()", biases.size(), "must be that of intervals");
  for (std::size_t i = 0; i < intervals.size(); ++i) {
    detail::check_interval({"intervals", i}, samples, intervals[i], options);
    detail::check_bias({"biases", i}, biases[i]);
  }
  packed_inputs inputs;
  const auto times = inputs.place<std::int64_t>(samples.t_ns.size());
  const auto measured = inputs.place<imu_sample>(samples.sample.size());
  const auto given = inputs.place<imu_interval>(intervals.size());
  const auto at = inputs.place<imu_bias<S>>(biases.size());
  ctx.begin_call();
  const upload_block block = ctx.begin_upload(result.inputs(), inputs.bytes());
  preintegration<S>* to = result.make_room(intervals.size());
  times.copy(block, samples.t_ns.data()), measured.copy(block, samples.sample.data());
  given.copy(block, intervals.data()), at.copy(block, biases.data());
  ctx.send(block, inputs.bytes());
  launch_preintegrate(ctx.policy(), static_cast<int>(intervals.size()),
                      detail::preintegrate_one<S>{times.resident(block), measured.resident(block),
                                                  given.resident(block), at.resident(block), options, to});
}

/// The same for one interval, on the host.
template <class S>
preintegration<S> preintegrate(const imu_samples& samples, const imu_interval& interval, const imu_bias<S>& bias,
                               const preintegration_options& options) {
  detail::check_preintegration_options(options);
  detail::check_interval("interval", samples, interval, options);
  detail::check_bias("bias", bias);
  return detail::integrate_interval(samples.t_ns.data(), samples.sample.data(), interval, bias, options);
}

TURBOMAP_END_NAMESPACE
