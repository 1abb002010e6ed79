// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Lets every allocation of a call fail, one after the other; or all else that can fail and is counted.

#include <new>

namespace turbomap_test {

/// Lets allocation 0, 1, 2... fail until the call succeeds. \return how often it failed
/// \tparam Limit  Limit(n): as long as it lives, allocation n and all after it fail
/// \tparam Error  what a failure is thrown as
/// \param check   what must hold after each failure
template <class Limit, class Error = std::bad_alloc, class Call, class Check>
int fail_everywhere(Call call, Check check) {
  for (int failures = 0;; ++failures) {
    try {
      const Limit limit(failures);
      call();
      return failures;
    } catch (const Error&) {
    }
    check();
  }
}

}  // namespace turbomap_test
