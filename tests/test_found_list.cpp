// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Lists of what indices have found, on the host.

#include "found_list_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;

TEST_CASE_TEMPLATE("as a loop writes them", policy, TURBOMAP_TEST_POLICIES) { check_found_lists(policy{}); }

}  // namespace
