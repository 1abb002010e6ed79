// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The main function of every test program. Exit status: doctest's (0 passed, 1 failed), and 77 when nothing failed and
/// every test case that ran skipped itself (turbomap_test::skip). A program without any test case fails. Compiled a second
/// time with TURBOMAP_TEST_NEEDS_DEVICE for the tests under nvcc: without a device these end at once with 77.

#define DOCTEST_CONFIG_IMPLEMENT
#include <doctest/doctest.h>

#include <cstdio>

#include "support.hpp"
#include "under_tsan.hpp"

#if defined(TURBOMAP_TEST_NEEDS_DEVICE)
#include <cuda_runtime_api.h>
#endif

#if defined(TURBOMAP_TEST_UNDER_TSAN) && defined(TURBOMAP_WITH_TBB)
#include <tbb/global_control.h>
#endif

namespace {

constexpr int skipped_status = 77;

bool current_case_skipped = false;
unsigned skipped_cases = 0;
unsigned finished_cases = 0;

/// Counts the test cases that ran and those that skipped themselves.
struct skip_counter : doctest::IReporter {
  explicit skip_counter(const doctest::ContextOptions&) {}
  void report_query(const doctest::QueryData&) override {}
  void test_run_start() override {}
  void test_run_end(const doctest::TestRunStats&) override {}
  void test_case_start(const doctest::TestCaseData&) override { current_case_skipped = false; }
  void test_case_reenter(const doctest::TestCaseData&) override {}
  void test_case_end(const doctest::CurrentTestCaseStats&) override {
    ++finished_cases;
    if (current_case_skipped) ++skipped_cases;
  }
  void test_case_exception(const doctest::TestCaseException&) override {}
  void subcase_start(const doctest::SubcaseSignature&) override {}
  void subcase_end() override {}
  void log_assert(const doctest::AssertData&) override {}
  void log_message(const doctest::MessageData&) override {}
  void test_case_skipped(const doctest::TestCaseData&) override {}
};
REGISTER_LISTENER("skip_counter", 1, skip_counter);

}  // namespace

void turbomap_test::skip(const std::string& reason) {
  current_case_skipped = true;
  std::printf("turbomap-test skipped: %s\n", reason.c_str());
}

int main(int argc, char** argv) {
#if defined(TURBOMAP_TEST_NEEDS_DEVICE)
  int devices = 0;
  if (const auto status = cudaGetDeviceCount(&devices); status != cudaSuccess || devices == 0) {
    std::printf("turbomap-test skipped: no CUDA device (%s)\n", cudaGetErrorString(status));
    return skipped_status;
  }
#endif
#if defined(TURBOMAP_TEST_UNDER_TSAN) && defined(TURBOMAP_WITH_TBB)
  const tbb::global_control one_worker(tbb::global_control::max_allowed_parallelism, 1);
#endif
  doctest::Context context(argc, argv);
  const int status = context.run();
  if (context.shouldExit() || status != 0) return status;
  if (finished_cases == 0) {
    std::printf("turbomap-test: no test case ran\n");
    return 1;
  }
  if (skipped_cases > 0) std::printf("turbomap-test: %u of %u test cases skipped\n", skipped_cases, finished_cases);
  return skipped_cases == finished_cases ? skipped_status : 0;
}
