// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// TURBOMAP_TEST_UNDER_TSAN, where a test is compiled for the thread sanitizer. That does not see the synchronisation inside the
/// OpenMP and TBB run-times, which are not compiled with it, and would report each parallel loop. With one worker each (for
/// OpenMP by the environment, see CMakeLists.txt) it sees what these tests are about: our own threads.

#if defined(__has_feature)
#if __has_feature(thread_sanitizer)
#define TURBOMAP_TEST_UNDER_TSAN 1
#endif
#endif
#if defined(__SANITIZE_THREAD__)
#define TURBOMAP_TEST_UNDER_TSAN 1
#endif
