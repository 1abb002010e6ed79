// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Bundle adjustment of a user's own factors, with a landmark, of a frame and between two, in every solver and precision:
// some have a derivative of their own, some none where they are 0, some are not defined everywhere, and their rows hold
// any numbers. Costs, chi2 and rows that are not defined are those of a plain sum over the factors.

#include <thrust/execution_policy.h>

#include <cmath>
#include <cstring>
#include <type_traits>
#include <vector>

#include <turbomap/adjustment/covariance.hpp>
#include <turbomap/adjustment/levenberg_marquardt.hpp>

#include "adjustment/adjustment_factors.hpp"
#include "hostile.hpp"

using namespace turbomap_fuzz;

namespace {

using policy = std::decay_t<decltype(thrust::seq)>;
using pose = turbomap::rigid_transform<double>;
using point = turbomap::vec3<double>;

/// The distance of a landmark from the frame. At 0 its derivative is no number.
struct range_factor {
  static constexpr int size = 1;
  struct row {
    double range;
  };
  template <class S>
  bool residual(const turbomap::rigid_transform<S>& T_cw, const turbomap::vec3<S>& landmark, const row& r, S* e) const {
    using std::sqrt;
    const turbomap::vec3<S> p = turbomap::to_isometry<S>(T_cw) * landmark;
    e[0] = sqrt(p.x * p.x + p.y * p.y + p.z * p.z) - S(r.range);
    return true;
  }
};

/// Where a landmark is in the frame, before a plane: behind it nothing is defined.
struct place_factor {
  static constexpr int size = 3;
  struct row {
    point place;
    double plane;
  };
  template <class S>
  bool residual(const turbomap::rigid_transform<S>& T_cw, const turbomap::vec3<S>& landmark, const row& r, S* e) const {
    const turbomap::vec3<S> p = turbomap::to_isometry<S>(T_cw) * landmark;
    if (!(p.z > S(r.plane))) return false;
    e[0] = p.x - S(r.place.x), e[1] = p.y - S(r.place.y), e[2] = p.z - S(r.place.z);
    return true;
  }
};
/// The same with its derivative.
struct linearised_place_factor : place_factor {
  bool linearise(const pose& T_cw, const point& landmark, const row& r, double* e, double* d_frame,
                 double* d_landmark) const {
    if (!residual(T_cw, landmark, r, e)) return false;
    const auto T = turbomap::to_isometry<double>(T_cw);
    const point p = T * landmark;
    const double turn[3][3] = {{0, p.z, -p.y}, {-p.z, 0, p.x}, {p.y, -p.x, 0}};  // exp(omega) p = p + omega x p
    for (int k = 0; k < 3; ++k)
      for (int i = 0; i < 3; ++i) {
        d_frame[6 * k + i] = turn[k][i], d_frame[6 * k + 3 + i] = i == k ? 1 : 0;
        d_landmark[3 * k + i] = T.R(k, i);
      }
    return true;
  }
};

template <class Row>
struct rows {
  std::vector<std::int32_t> first, second;  ///< frames, and landmarks or other frames
  std::vector<Row> data;
  void add(std::size_t a, std::size_t b, const Row& row) {
    first.push_back(static_cast<std::int32_t>(a)), second.push_back(static_cast<std::int32_t>(b)), data.push_back(row);
  }
};

/// Poses in a line, landmarks before them, and what their factors expect, a little off; then some numbers are replaced.
struct world {
  std::vector<pose> poses;
  std::vector<point> points;
  std::vector<std::uint8_t> fixed, fixed_points;
  std::vector<std::uint32_t> held;
  rows<range_factor::row> ranges;
  rows<place_factor::row> places;
  rows<turbomap_test::prior_factor::row> priors;
  rows<turbomap_test::odometry_factor::row> odometry;
  bool spoilt = false;       ///< some numbers are not those of a world
  bool bad_indices = false;  ///< an index is wrong

  explicit world(choices& c) {
    for (std::size_t i = 0, n = 1 + c.below(5); i < n; ++i) {
      pose T;
      T.tx = -0.3 * static_cast<double>(i), T.qy = 0.02 * static_cast<double>(i), T.qw = std::sqrt(1 - T.qy * T.qy);
      poses.push_back(T), fixed.push_back(c.byte() % 4 == 0 ? 1 : 0);
      held.push_back(c.byte() % 4 == 3 ? c.byte() : 0);
    }
    for (std::size_t i = 0, n = c.below(7); i < n; ++i) {
      points.push_back({0.2 * static_cast<double>(c.below(20)) - 2, 0.2 * static_cast<double>(c.below(10)) - 1,
                        1 + 0.5 * static_cast<double>(c.below(20))});
      fixed_points.push_back(c.byte() % 5 == 0 ? 1 : 0);
    }
    for (std::size_t f = 0; f < poses.size(); ++f) {
      for (std::size_t l = 0; l < points.size(); ++l) expect_point(f, l, c);
      if (c.byte() % 4 == 3) priors.add(f, 0, {poses[f]});
      if (c.flag() && f > 0)
        odometry.add(f - 1, f, {{noise(c) - 0.15, 0, 0}}), c.flag() ? odometry.add(f, f - 1, {}) : void();
    }
    for (unsigned n = c.byte() % 8; n > 0; --n) spoil_one(c);
  }

 private:
  static double noise(choices& c) { return static_cast<double>(c.byte()) / 1024 - 0.125; }
  void expect_point(std::size_t f, std::size_t l, choices& c) {
    const unsigned kinds = c.byte();
    const point p = turbomap::to_isometry<double>(poses[f]) * points[l];
    if (kinds & 1U) ranges.add(f, l, {std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z) + noise(c)});
    if (kinds & 2U) places.add(f, l, {{p.x + noise(c), p.y, p.z + noise(c)}, 0.1});
    if (kinds % 64 == 63) places.add(f, l, places.data.back());
  }
  void spoil_one(choices& c) {
    const unsigned what = c.byte() % 8;
    const std::size_t f = c.below(poses.size());
    spoilt = true;
    if (what == 0) spoil(poses[f], c);
    if (what == 1 && !points.empty()) points[c.below(points.size())] = c.vector(20);
    if (what == 2 && !points.empty()) {  // a landmark in the centre of a frame
      const auto T = turbomap::inverse(turbomap::to_isometry<double>(poses[f]));
      points[c.below(points.size())] = T.t;
    }
    if (what == 3 && !ranges.data.empty()) ranges.data[c.below(ranges.data.size())].range = c.number(20);
    if (what == 4 && !places.data.empty()) {
      auto& row = places.data[c.below(places.data.size())];
      c.flag() ? row.place = c.vector(20), void() : void(row.plane = c.number(20));
    }
    if (what == 5 && !priors.data.empty()) spoil(priors.data[c.below(priors.data.size())].T_cw, c);
    if (what == 6 && !odometry.data.empty()) odometry.data[c.below(odometry.data.size())].shift = c.vector(3);
    if (what == 7 && c.byte() % 4 == 3) spoil_index(c);
  }
  void spoil_index(choices& c) {
    const auto wrong = static_cast<std::int32_t>(c.flag() ? -1 : 100);
    if (c.flag() && !ranges.first.empty())
      (c.flag() ? ranges.first : ranges.second)[c.below(ranges.first.size())] = wrong, bad_indices = true;
    else if (c.flag() && !priors.first.empty())
      priors.first[c.below(priors.first.size())] = wrong, bad_indices = true;
    else if (!odometry.first.empty())  // or a frame with itself
      odometry.second[0] = c.flag() ? wrong : odometry.first[0], bad_indices = true;
  }
};

/// What a group of factors costs: a plain sum.
struct plain_sum {
  double cost = 0;
  int undefined = 0;
  std::vector<double> chi2;  ///< of each row, one group after the other

  template <int Size, class Residual, class Kernel>
  void add(Residual residual, const Kernel& kernel) {
    double e[Size], rho, weight;
    const bool defined = residual(e);
    double s = defined ? 0 : 1e6;
    for (int k = 0; defined && k < Size; ++k) s += e[k] * e[k];
    kernel(s, rho, weight);
    cost += rho, undefined += defined ? 0 : 1, chi2.push_back(s);
  }
};

bool near(double a, double b, double relative) { return std::abs(a - b) <= relative * (1 + std::abs(a) + std::abs(b)); }
bool same(const pose& a, const pose& b) { return std::memcmp(&a, &b, sizeof(pose)) == 0; }

/// \tparam Place  with a derivative of its own, or without
template <class Place>
class adjusted {
  using ranges = turbomap::landmark_factors<range_factor, turbomap::cauchy>;
  using places = turbomap::landmark_factors<Place, turbomap::huber>;
  using priors = turbomap::frame_factors<turbomap_test::prior_factor>;
  using odometry = turbomap::frame_pair_factors<turbomap_test::odometry_factor, turbomap::huber>;

 public:
  /// \return false: the problem was refused
  bool operator()(const world& w, const turbomap::adjustment_options& o) {
    ranges_.frame = w.ranges.first, ranges_.landmark = w.ranges.second, ranges_.rows = w.ranges.data;
    places_.frame = w.places.first, places_.landmark = w.places.second, places_.rows = w.places.data;
    priors_.frame = w.priors.first, priors_.rows = w.priors.data;
    odometry_.first = w.odometry.first, odometry_.second = w.odometry.second, odometry_.rows = w.odometry.data;
    const bool taken = allowed([&] {
      problem_.assign(ctx_, {w.poses, w.fixed, w.held}, {w.points, w.fixed_points}, ranges_, places_, priors_,
                      odometry_);
    });
    expect(!(w.bad_indices && taken), "wrong indices are refused");
    expect(w.spoilt || taken, "a good problem is taken");
    if (!taken) return false;
    summary = turbomap::adjust<turbomap::every_adjustment_method>(ctx_, problem_, o);
    problem_.frames(ctx_, poses), problem_.landmarks(ctx_, points);
    check_estimate(w);
    check_costs(w);
    return true;
  }
  /// What nothing tells.
  void look_for_open_directions(const world& w) {
    const int open = turbomap::undetermined_directions(ctx_, problem_);
    std::vector<std::int32_t> frames;
    int unknowns = 0;
    for (std::size_t f = 0; f < w.poses.size(); ++f)
      for (std::size_t i = 0; i < 6; ++i) unknowns += is_known(w, f, i) ? 0 : 1;
    for (std::size_t f = 0; f < w.poses.size(); ++f) frames.push_back(static_cast<std::int32_t>(f));
    expect(open >= 0 && open <= unknowns, "there are no more directions than unknowns");
    std::vector<double> covariance;
    const bool all = turbomap::frame_covariance(ctx_, problem_, turbomap::span<const std::int32_t>(frames), covariance);
    expect(!all || open == 0, "where every frame is determined nothing is open");
    expect(all || open > 0 || w.spoilt, "where nothing is open every frame is determined");
    const std::size_t n = 6 * frames.size();
    for (std::size_t i = 0; all && i < n; ++i) {
      const double variance = covariance[(n + 1) * i];
      expect(std::isfinite(variance) && variance >= 0, "variances are finite");
      expect(!is_known(w, i / 6, i % 6) || variance == 0, "what is held is known");
    }
  }

  turbomap::adjustment_summary summary;
  std::vector<pose> poses;
  std::vector<point> points;

 private:
  /// Unknown i of frame f does not move.
  static bool is_known(const world& w, std::size_t f, std::size_t i) {
    return w.fixed[f] != 0 || (w.held[f] >> i & 1U) != 0;
  }
  void check_estimate(const world& w) const {
    const bool moved = summary.accepted > 0;
    expect(!moved || (finite({summary.cost_final}) && summary.cost_final <= summary.cost_initial),
           "steps lower the cost");
    for (std::size_t f = 0; f < poses.size(); ++f) {
      expect(!moved || is_unit(poses[f]), "poses are poses");
      if (!moved || w.fixed[f] != 0) expect(same(poses[f], w.poses[f]), "what is fixed stays, and all without a step");
      const pose &x = poses[f], &given = w.poses[f];
      if (moved && (w.held[f] & 7U) == 7U)  // but for the length of the quaternion
        expect(near(x.qx, given.qx, 1e-3) && near(x.qy, given.qy, 1e-3) && near(x.qz, given.qz, 1e-3) &&
                   near(x.qw, given.qw, 1e-3),
               "a rotation whose unknowns are held stays");
      if (moved && (w.held[f] & 63U) == 63U)
        expect(near(x.tx, given.tx, 1e-9) && near(x.ty, given.ty, 1e-9) && near(x.tz, given.tz, 1e-9),
               "a frame whose unknowns are all held stays");
    }
    for (std::size_t l = 0; l < points.size(); ++l) {
      const auto &x = points[l], &given = w.points[l];
      expect(!moved || finite({x.x, x.y, x.z}), "landmarks are finite");
      if (!moved) expect(std::memcmp(&x, &given, sizeof(point)) == 0, "without a step all stays");
      if (moved && w.fixed_points[l] != 0)  // -0 becomes 0
        expect(x.x == given.x && x.y == given.y && x.z == given.z, "landmarks that are fixed stay");
    }
  }
  void check_costs(const world& w) {
    using turbomap::adjustment_end;
    if (summary.end == adjustment_end::no_observations) return;
    const plain_sum before = sum(w, w.poses, w.points), after = sum(w, poses, points);
    const bool numbers = all_finite(w) && std::isfinite(before.cost);
    expect((summary.end == adjustment_end::not_finite) != numbers, "only what is not finite is not adjusted");
    expect(numbers || summary.accepted == 0, "what is not finite is not adjusted");
    if (!numbers) return;
    expect(near(summary.cost_initial, before.cost, 1e-9), "the cost is the sum over the factors");
    expect(near(summary.cost_final, after.cost, 1e-9), "the cost is the sum over the factors, at the end too");
    expect(summary.undefined == after.undefined, "rows that are not defined are counted");
    std::vector<double> chi2, more, depth;
    problem_.template chi2<0>(ctx_, chi2, depth), problem_.template chi2<1>(ctx_, more, depth);
    expect(chi2.size() == w.ranges.data.size() && more.size() == w.places.data.size(), "every row has its chi2");
    chi2.insert(chi2.end(), more.begin(), more.end());
    for (std::size_t i = 0; i < chi2.size(); ++i)
      expect(near(chi2[i], after.chi2[i], 1e-9), "chi2 is that of the factor");
  }
  static bool all_finite(const world& w) {
    bool all = true;
    for (const auto& T : w.poses) all = all && finite({T.qx, T.qy, T.qz, T.qw, T.tx, T.ty, T.tz});
    for (const auto& x : w.points) all = all && finite({x.x, x.y, x.z});
    return all;
  }
  plain_sum sum(const world& w, const std::vector<pose>& T, const std::vector<point>& x) const {
    const auto at = [](std::int32_t i) { return static_cast<std::size_t>(i); };
    plain_sum all;
    for (std::size_t i = 0; i < w.ranges.data.size(); ++i)
      all.add<1>(
          [&](double* e) {
            return ranges_.factor.residual(T[at(w.ranges.first[i])], x[at(w.ranges.second[i])], w.ranges.data[i], e);
          },
          ranges_.kernel);
    for (std::size_t i = 0; i < w.places.data.size(); ++i)
      all.add<3>(
          [&](double* e) {
            return places_.factor.residual(T[at(w.places.first[i])], x[at(w.places.second[i])], w.places.data[i], e);
          },
          places_.kernel);
    for (std::size_t i = 0; i < w.priors.data.size(); ++i)
      all.add<6>([&](double* e) { return priors_.factor.residual(T[at(w.priors.first[i])], w.priors.data[i], e); },
                 priors_.kernel);
    for (std::size_t i = 0; i < w.odometry.data.size(); ++i)
      all.add<3>(
          [&](double* e) {
            return odometry_.factor.residual(T[at(w.odometry.first[i])], T[at(w.odometry.second[i])],
                                             w.odometry.data[i], e);
          },
          odometry_.kernel);
    return all;
  }

  turbomap::context<policy> ctx_;
  turbomap::bundle_problem<policy, turbomap::pose_frame, ranges, places, priors, odometry> problem_{ctx_};
  ranges ranges_{};
  places places_{};
  priors priors_{{10}, {}, {}};
  odometry odometry_{{5}, {}, {}, {}};
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  turbomap::adjustment_options o;
  o.max_iterations = static_cast<int>(c.below(6)), o.max_retries = static_cast<int>(c.below(8));
  o.damping = c.flag() ? turbomap::damping_rule::identity : turbomap::damping_rule::diagonal;
  o.solver = static_cast<turbomap::reduced_solver>(c.below(4));
  o.numbers = static_cast<turbomap::precision>(c.below(3));
  const bool directions = c.byte() % 4 == 1, twice = c.byte() % 4 == 1;
  const world w(c);
  adjusted<linearised_place_factor> mine;
  if (!mine(w, o)) return 0;
  if (directions) mine.look_for_open_directions(w);
  if (!twice) return 0;
  adjusted<place_factor> dual;
  expect(dual(w, o), "derivatives do not decide what is refused");
  if (!w.spoilt && o.numbers == turbomap::precision::float64)
    expect(near(mine.summary.cost_final, dual.summary.cost_final, 1e-6), "both derivatives lead to the same cost");
  return 0;
}
