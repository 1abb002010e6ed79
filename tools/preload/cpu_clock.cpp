// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Times in processor time of the calling thread, for an unchanged program on a machine that other work shares: what others do is not
/// counted (but for caches, which they share). A library that takes the place of the monotonic clock:
///
///     LD_PRELOAD=libturbomap-cpu-clock.so turbomap-replay RECORDING
///
/// Only for programs of one thread that do not wait: policy seq, without --queue and deadlines.

#include <ctime>

#include <sys/syscall.h>
#include <unistd.h>

extern "C" int clock_gettime(clockid_t clock, timespec* time) noexcept {
  const clockid_t asked = clock == CLOCK_MONOTONIC ? CLOCK_THREAD_CPUTIME_ID : clock;
  return static_cast<int>(syscall(SYS_clock_gettime, asked, time));
}
