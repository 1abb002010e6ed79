// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// What turbomap-bundle says of an input that holds no problem, and of noise that is not for it.

#include <stdexcept>
#include <string>

#include <doctest/doctest.h>

#include "bundle/load.hpp"
#include "bundle/run.hpp"
#include "support/files.hpp"

using turbomap_test::bad_file_message;
using turbomap_test::has;

TEST_CASE("a folder without a file of the format is named, and the file that it lacks") {
  const turbomap_test::temporary_directory folder;
  turbomap_bundle::arguments a;
  a.input = folder.path();
  const auto error = [&](const std::string& format) {
    return bad_file_message([&] { turbomap_bundle::load(a, format); });
  };
  CHECK(has(error("bal"), folder.path().string() + ": holds no file named problem-*"));
  CHECK(has(error("kitti-stereo"), folder.path().string() + ": holds no file named VO_stereo_factors*"));
  for (const char* format : {"schur", "lba", "colmap"}) {
    CAPTURE(format);
    CHECK(has(error(format), folder.path().string()));
  }
  CHECK(has(bad_file_message([&] { turbomap_bundle::format_of(a.input); }), "holds no problem of a known format"));
}

TEST_CASE("a problem that cannot be perturbed is not taken as it is where that is asked for") {
  turbomap_bundle::arguments a;
  a.input = "20,100,400", a.format = "generated";
  turbomap_bundle::load(a, a.format);
  for (double* noise : {&a.perturb_m, &a.perturb_rad}) {
    *noise = 0.1;
    CHECK_THROWS_WITH_AS(turbomap_bundle::load(a, a.format), doctest::Contains("--perturb-m"), std::invalid_argument);
    *noise = 0;
  }
}

TEST_CASE("what a problem does not need is refused by name") {
  turbomap_bundle::arguments a;
  a.input = "20,100,400", a.format = "generated", a.camera = {435, 435, 367, 252, 0};
  CHECK_THROWS_WITH_AS(turbomap_bundle::load(a, a.format), doctest::Contains("--camera"), std::invalid_argument);

  const turbomap_bundle::arguments usual;
  CHECK_NOTHROW(turbomap_bundle::refuse_adjustment(usual));
  const auto refused = [&](const char* option, auto change) {
    auto given = usual;
    change(given);
    CHECK_THROWS_WITH_AS(turbomap_bundle::refuse_adjustment(given), doctest::Contains(option), std::invalid_argument);
  };
  refused("--solver", [](auto& g) { g.solver = "dense"; });
  refused("--precision", [](auto& g) { g.precision = "float32"; });
  refused("--kernel", [](auto& g) { g.kernel = "none"; });
  refused("--damping", [](auto& g) { g.damping = "identity"; });
  refused("--iterations", [](auto& g) { g.iterations = 3; });
  refused("--lambda-scale", [](auto& g) { g.lambda_scale = 1; });
}
