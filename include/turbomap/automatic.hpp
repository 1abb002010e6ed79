// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Two contexts, one on the host and one on a device, and the choice between them for each call: by its size.

#include <chrono>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "config.hpp"
#include "context.hpp"
#include "crossover.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Runs each piece of work where it is faster. Where that is, is given (use()), fixed (pin()), or measured by the calls
/// themselves: the first few of each size run on both sides in turns. Integers and decisions are the same on both sides, other
/// numbers within 1e-9 in float64, and as far as float goes in mixed precision; so two runs give the same bits if crossovers are
/// given, not while they are measured. Of one thread, like a context. Move-only.
template <class Host, class Device, class Clock = std::chrono::steady_clock>
class automatic {
 public:
  /// Makes a context of each policy.
  automatic(Host host, Device device) : host_(std::move(host)), device_(std::move(device)) {}

  /// Where small calls run.
  context<Host>& host() { return host_; }
  /// Where large calls run.
  context<Device>& device() { return device_; }

  /// From now on by these crossovers, e.g. of read_crossover().
  void use(const crossover& known) { known_ = known, choice_ = choice::known; }
  /// From now on always there.
  void pin(work_side side) { pinned_ = side, choice_ = choice::pinned; }
  /// From now on by what calls take, as at first.
  void measure() { choice_ = choice::measured; }
  /// What was measured so far, e.g. for write_crossover() (io/crossover_file.hpp).
  crossover measured() const { return times_.result(); }

  /// Where the next call of this kind and amount will run.
  work_side side(work_kind kind, double amount) const {
    if (choice_ == choice::pinned) return pinned_;
    return choice_ == choice::known ? known_.side(kind, amount) : times_.next(kind, amount);
  }
  /// Calls work(ctx) with the context that is faster. `work` puts its data where that context computes, and copies the result
  /// out; its type is the same for both. While it is measured, the call also waits for the context. A side whose first
  /// crossover_measurement::samples calls of a size all throw is not taken for that size. Errors of the caller
  /// (std::invalid_argument) are the same on both sides and do not count. Throws what work throws.
  template <class Work>
  auto run(work_kind kind, double amount, Work&& work) {
    const work_side where = side(kind, amount);
    const stopwatch watch{*this, kind, amount, where, choice_ == choice::measured};
    if (where == work_side::device) return watch.run(device_, work);
    return watch.run(host_, work);
  }

 private:
  enum class choice : std::uint8_t { measured, known, pinned };
  struct stopwatch {
    automatic& all;
    work_kind kind;
    double amount;
    work_side where;
    bool on;

    template <class Context, class Work>
    auto run(Context& ctx, Work& work) const {
      const auto begin = on ? Clock::now() : typename Clock::time_point{};
      try {
        if constexpr (std::is_void_v<decltype(work(ctx))>) {
          work(ctx);
          stop(ctx, begin);
        } else {
          auto result = work(ctx);
          stop(ctx, begin);
          return result;
        }
      } catch (const std::invalid_argument&) {  // of the caller: says nothing about this side
        throw;
      } catch (...) {  // counted, so that the next call of this size tries the other side
        if (on) all.times_.record(kind, amount, where, std::numeric_limits<double>::infinity());
        throw;
      }
    }
    template <class Context>
    void stop(Context& ctx, typename Clock::time_point begin) const {
      if (!on) return;
      ctx.synchronize();
      all.times_.record(kind, amount, where, std::chrono::duration<double>(Clock::now() - begin).count());
    }
  };

  context<Host> host_;
  context<Device> device_;
  crossover known_;
  crossover_measurement times_;
  work_side pinned_ = work_side::host;
  choice choice_ = choice::measured;
};

/// `automatic both{thrust::seq, thrust::cuda::par};`
template <class Host, class Device>
automatic(Host, Device) -> automatic<Host, Device>;

TURBOMAP_END_NAMESPACE
