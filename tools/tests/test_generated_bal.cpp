// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Problems that turbomap-bundle makes: of the size that was asked for, the same each time, and with a solution.

#include <turbomap/adjustment/levenberg_marquardt.hpp>
#include <turbomap/adjustment/problem.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "bundle/generated_bal.hpp"

namespace {

using turbomap_bundle::generate_bal;
using turbomap_bundle::parse_generated_size;

TEST_CASE("a problem has the size that was asked for, and a solution") {
  const auto p = generate_bal(parse_generated_size("60,2000,9000"), 3);
  CHECK(p.cameras.size() == 60);
  CHECK(p.points.size() == 2000);
  CHECK(p.pixel.size() > 8000);
  CHECK(p.pixel.size() < 10000);
  REQUIRE(p.camera.size() == p.pixel.size());
  REQUIRE(p.point.size() == p.pixel.size());
  std::vector<int> views(p.points.size());
  for (const auto i : p.point) ++views[static_cast<std::size_t>(i)];
  CHECK(*std::min_element(views.begin(), views.end()) >= 2);

  using group = turbomap::landmark_factors<turbomap::bal_reprojection, turbomap::huber>;
  turbomap::context ctx;
  turbomap::bundle_problem<thrust::detail::seq_t, turbomap::self_calibrated_frame, group> problem(ctx);
  std::vector<turbomap::self_calibrated_state<double>> states;
  for (const auto& c : p.cameras) states.push_back(turbomap::bal_state(c));
  turbomap::huber kernel;
  kernel.delta2 = 1e300;
  problem.assign(ctx, {{states.data(), states.size()}}, {{p.points.data(), p.points.size()}},
                 group{{},
                       {p.camera.data(), p.camera.size()},
                       {p.point.data(), p.point.size()},
                       {p.pixel.data(), p.pixel.size()},
                       kernel});
  using turbomap::reduced_solver;
  using methods = turbomap::adjustment_methods<turbomap::solver_list<reduced_solver::dense>>;
  turbomap::adjustment_options options;
  options.solver = reduced_solver::dense, options.max_iterations = 20;
  const auto summary = turbomap::adjust<methods>(ctx, problem, options);
  // Two numbers per observation, each 0.5 px off, less the freedom of points and cameras.
  const double degrees = 2.0 * static_cast<double>(p.pixel.size()) - 3 * 2000 - 9 * 60 + 7;
  const double expected = 0.25 * degrees;
  CHECK(summary.cost_initial > 50 * expected);
  CHECK(summary.cost_final > 0.95 * expected);
  CHECK(summary.cost_final < 1.05 * expected);
}

TEST_CASE("the same each time, another one for another seed") {
  const auto a = generate_bal({10, 50, 200}, 1), b = generate_bal({10, 50, 200}, 1), c = generate_bal({10, 50, 200}, 2);
  REQUIRE(a.pixel.size() == b.pixel.size());
  for (std::size_t i = 0; i < a.pixel.size(); ++i) CHECK(a.pixel[i].x == b.pixel[i].x);
  CHECK(a.pixel[0].x != c.pixel[0].x);
}

TEST_CASE("sizes that are none are refused") {
  for (const char* text : {"", "1,2,3", "10,50", "10,50,99", "10,50,200,1", "10,50,200x", "-10,50,200", "x",
                           "2,1,1000000000", "60,100,6000", "60,100,801", "2,100,201", "1,100,200"}) {
    CAPTURE(text);
    CHECK_THROWS_AS(parse_generated_size(text), std::invalid_argument);
  }
}

TEST_CASE("about as many observations as were asked for, up to the most, each of two cameras or more per point") {
  for (const char* text :
       {"2,200000,400000", "3,3000,7000", "10,3000,14000", "20,3000,24000", "60,3000,24000", "60,3000,6000"}) {
    CAPTURE(text);
    const auto size = parse_generated_size(text);
    const auto p = generate_bal(size, 5);
    CHECK(p.pixel.size() > 0.9 * static_cast<double>(size.observations));
    CHECK(p.pixel.size() < 1.1 * static_cast<double>(size.observations));
    std::set<std::pair<int, int>> pairs;
    std::vector<int> views(p.points.size());
    for (std::size_t i = 0; i < p.pixel.size(); ++i) {
      pairs.emplace(p.point[i], p.camera[i]);
      ++views[static_cast<std::size_t>(p.point[i])];
    }
    const auto [first, last] = std::minmax_element(p.camera.begin(), p.camera.end());
    CHECK((*first >= 0 && *last < size.cameras));
    CHECK(pairs.size() == p.pixel.size());
    CHECK(*std::min_element(views.begin(), views.end()) >= 2);
  }
}

TEST_CASE("a size that was not parsed makes what its cameras can see") {
  CHECK(generate_bal({2, 1, 1000000000}, 1).pixel.size() == 2);
  CHECK(generate_bal({1, 10, 20}, 1).pixel.size() == 10);
  CHECK(generate_bal({3, 0, 0}, 1).pixel.empty());
  CHECK(generate_bal({0, 3, 6}, 1).pixel.empty());
}

}  // namespace
