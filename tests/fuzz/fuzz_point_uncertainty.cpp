// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// How well a point is known from hostile views: none, one twice, behind the point or far away, of cameras that no lens is
// like, with noise of any size. Covariances are covariances, no larger than what is known beforehand, and smaller with every
// view; where a textbook can follow, they are the textbook's, and so are the gates that read them.

#include <cmath>
#include <type_traits>
#include <vector>

#include <turbomap/camera/point_uncertainty.hpp>
#include <turbomap/math/strict.hpp>

#include "hostile.hpp"
#include "hostile_cameras.hpp"
#include "reference/uncertainty_oracle.hpp"

using namespace turbomap_fuzz;

namespace {

using turbomap::decision;
using turbomap::symmetric3;
using turbomap::vec2;
using turbomap::vec3;
using turbomap_test::number;
using turbomap_test::oracle_pose;
using turbomap_test::to_eigen;
using turbomap_test::to_isometry;

template <class S>
vec3<S> to_vec3(const Eigen::Vector3d& x) {
  return {S(x.x()), S(x.y()), S(x.z())};
}

/// In double, or in strict numbers.
template <class S, class Camera>
class views_of_point {
  using view = turbomap_test::uncertainty_view<Camera>;

 public:
  views_of_point(const std::vector<view>& views, const Eigen::Vector3d& X, double distance)
      : X_(X), distance_(distance) {
    for (const auto& v : views) add(v);
  }
  const Eigen::Matrix3d& covariance() const { return covariance_; }
  /// None of the numbers is so far from the others that rounding is all there is.
  bool plain() const { return plain_; }

  /// Sigma of the point in one more view that is compared with it: the gate's chi-square of a difference.
  void compare(const view& v, const symmetric3<S>& covariance, const Eigen::Vector3d& difference, bool textbook) const {
    turbomap::projected_point<S> p;
    if (!turbomap::project_point(v.camera, to_isometry<S>(v.T_cw), S(v.bf), to_vec3<S>(X_), p)) return;
    const bool stereo = v.bf > 0;
    const symmetric3<S> M = turbomap::projected_covariance(covariance, p.by_X);
    const auto L = turbomap::spread_of_difference(M, stereo, S(v.sigma2), S(v.correlation));
    const double noise = stereo ? (1 - v.correlation * v.correlation) * v.sigma2 : v.sigma2;
    for (const S& d : {L.xx, L.yy, L.zz})
      expect(number(d) >= std::sqrt(noise) * (1 - 1e-12), "a pixel is never better known than its noise");
    if (!textbook || !v.differentiable(X_) || !turbomap_test::is_plain_spread(v, X_, to_eigen(covariance))) return;
    Eigen::VectorXd e = difference.head(v.size());
    const vec3<S> w = turbomap::solve_lower(L, to_vec3<S>({e(0), e(1), stereo ? e(2) : 0}));
    const double chi2 = number(turbomap::squared_norm(w));
    const double expected = e.dot(turbomap_test::oracle_spread(v, X_, to_eigen(covariance)).ldlt().solve(e));
    expect(std::abs(chi2 - expected) <= 1e-2 * (expected + 1e-6), "gates are those of a textbook");
    const double exact = e.dot(v.noise().ldlt().solve(e));
    expect(chi2 <= exact * (1 + 1e-2), "a point that is not exact fits a pixel better");
  }
  symmetric3<S> sigma() const { return turbomap::covariance_from(information_, S(distance_)); }

 private:
  void add(const view& v) {
    turbomap::projected_point<S> p;
    const vec3<S> X = to_vec3<S>(X_);
    if (turbomap::project_point(v.camera, to_isometry<S>(v.T_cw), S(v.bf), X, p)) {
      expect_projection(v, p);
      turbomap::add_information(information_, p, v.bf > 0, S(v.sigma2), S(v.correlation));
    }
    const Eigen::Matrix3d before = covariance_;
    const bool was_plain = plain_, first = !told_;
    const double all = to_eigen(information_).trace() * distance_ * distance_;
    plain_ = plain_ && std::isfinite(all) && all < 1e10;
    covariance_ = to_eigen(sigma()), told_ = true;
    if (!plain_) return;
    const double most = distance_ * distance_;
    for (int i = 0; i < 3; ++i) {
      expect(covariance_(i, i) >= 0 && std::isfinite(covariance_(i, i)), "variances are finite and not negative");
      expect(covariance_(i, i) <= most * (1 + 1e-4), "a point lies within its distance");
      expect(first || !was_plain || covariance_(i, i) <= before(i, i) + 1e-4 * before.trace(),
             "another view takes nothing away");
      for (int j = 0; j < i; ++j)
        expect(covariance_(i, j) * covariance_(i, j) <= covariance_(i, i) * covariance_(j, j) * (1 + 1e-9),
               "covariances are at most their variances'");
    }
  }
  void expect_projection(const view& v, const turbomap::projected_point<S>& p) const {
    vec2<S> pixel;
    const vec3<S> X_c = to_isometry<S>(v.T_cw) * to_vec3<S>(X_);
    expect(v.camera.project(X_c, pixel), "only what the model projects is projected");
    const auto same = [](const S& a, const S& b) { return number(a) == number(b) || !(number(a) == number(a)); };
    expect(same(pixel.x, p.pixel.x) && same(pixel.y, p.pixel.y) && same(X_c.z, p.depth), "pixels are the camera's");
    if (!(v.bf > 0)) {
      expect(number(p.u_right) == 0 && number(turbomap::squared_norm(p.by_X[2])) == 0, "no right image, no row of it");
      return;
    }
    expect(number(p.depth) > 0, "what a right image sees is before it");
    const double right = number(p.pixel.x) - v.bf / number(p.depth),
                 size = std::abs(number(p.pixel.x)) + std::abs(right);
    if (std::isfinite(size)) expect(std::abs(number(p.u_right) - right) <= 1e-12 * size, "u_right is u - bf / z");
  }

  Eigen::Vector3d X_;
  double distance_;
  symmetric3<S> information_;
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();
  bool plain_ = true, told_ = false;
};

template <class Camera>
class problem {
  using view = turbomap_test::uncertainty_view<Camera>;

 public:
  problem(const turbomap_test::test_rig<Camera>& rig, lens how, choices& c) : rig_(rig), how_(how) {
    const auto x = c.byte() % 8 == 7 ? c.vector(20) : vec3<double>{ordinary(c, 2), ordinary(c, 2), 3 + ordinary(c, 2)};
    X_ = {x.x, x.y, x.z};
    for (std::size_t n = c.below(6); n > 0; --n) {
      const bool twice = c.byte() % 4 == 3 && !views_.empty();
      views_.push_back(twice ? views_[c.below(views_.size())] : draw(c));
    }
    for (const auto& v : views_) distance_ = std::max(distance_, (v.T_cw * X_).norm());
  }
  void run(choices& c) const {
    const bool known = distance_ > 1e-6 && distance_ < 1e15;  // m; and numbers are left for its square
    if (!finite({X_.x(), X_.y(), X_.z()}) || !known) return;
    const views_of_point<double, Camera> plain(views_, X_, distance_);
    const views_of_point<decision, Camera> strict(views_, X_, distance_);
    if (plain.plain() && strict.plain() && has_derivatives())
      expect((plain.covariance() - strict.covariance()).norm() <= 1e-4 * strict.covariance().norm(),
             "strict numbers know as much");
    const bool textbook = strict.plain() && is_textbook();
    if (textbook && !views_.empty()) {
      const Eigen::Matrix3d expected = turbomap_test::oracle_point_covariance(views_, X_);
      for (const auto* mine : {&plain.covariance(), &strict.covariance()})
        expect((*mine - expected).norm() <= 1e-4 * expected.norm(), "covariances are those of a textbook");
    }
    if (views_.empty()) return;
    const view other = c.flag() ? views_[c.below(views_.size())] : draw(c);
    const Eigen::Vector3d e(ordinary(c, 10), ordinary(c, 10), ordinary(c, 10));
    strict.compare(other, strict.sigma(), e, textbook && is_textbook(other));
    plain.compare(other, plain.sigma(), e, textbook && is_textbook(other));
    symmetric3<decision> any;  // no covariance
    for (decision* x : {&any.xx, &any.yx, &any.yy, &any.zx, &any.zy, &any.zz}) *x = decision(c.number(1));
    strict.compare(other, any, e, false);
  }

 private:
  static double ordinary(choices& c, double scale) { return scale * (c.word() / 32768.0 - 1); }

  view draw(choices& c) const {
    const auto& mounted = rig_.cameras[c.below(rig_.cameras.size())];
    turbomap::rigid_transform<double> T;  // a turn of up to half a radian
    const double turn = 0.25 * ordinary(c, 1);
    T.qy = std::sin(turn), T.qw = std::cos(turn);
    T.tx = ordinary(c, 1), T.ty = ordinary(c, 0.2), T.tz = ordinary(c, 1);
    if (c.byte() % 8 == 7) spoil(T, c);
    if (!is_pose(T, 1e-3)) T = {};  // no keyframe has one
    view v{mounted.camera, turbomap_test::to_oracle_pose(mounted.T_camera_body) * turbomap_test::to_oracle_pose(T)};
    const unsigned kind = c.byte();
    v.bf = kind % 2 == 0 ? 0 : 50;
    v.sigma2 = std::pow(1.44, kind / 2 % 8);
    v.correlation = kind / 16 % 4 == 3 ? 0 : c.byte() / 256.0;
    if (kind / 64 == 3) v.bf = std::abs(c.number(50)), v.sigma2 = std::abs(c.number(4));
    if (!(v.bf > 0 && std::isfinite(v.bf))) v.bf = 0;
    if (!(v.sigma2 > 1e-6 && v.sigma2 < 1e6)) v.sigma2 = 1;
    return v;
  }
  /// Strict numbers take differences where a model brings no derivative, double ones dual numbers: the same where differences
  /// stand for derivatives.
  bool has_derivatives() const { return turbomap::has_jacobian_v<Camera> || is_textbook(); }
  /// Differences stand for derivatives: the point is not so far from the origin that they are rounding, nor nearly straight
  /// behind a lens that sees there, where a pixel turns about the centre within a step of them.
  bool is_textbook(const view& v) const {
    const Eigen::Vector3d x = v.T_cw * X_;
    const double away = x.norm();
    return how_ != lens::hostile && v.differentiable(X_) && X_.norm() + v.T_cw.t.norm() < 1e3 * away &&
           (v.bf > 0 ? x.z() : std::abs(x.z())) > 1e-2 * away && x.z() > -0.99 * away;
  }
  bool is_textbook() const {
    for (const auto& v : views_)
      if (!is_textbook(v)) return false;
    return true;
  }

  turbomap_test::test_rig<Camera> rig_;
  lens how_;
  Eigen::Vector3d X_;
  std::vector<view> views_;
  double distance_ = 0;
};

template <class Camera>
void run(turbomap_test::test_rig<Camera> rig, choices& c) {
  const auto how = static_cast<lens>(c.below(3));
  if (bend(rig, how, c)) problem<Camera>(rig, how, c).run(c);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  return run_on_models(c, 8, [&](const auto& rig) { run(rig, c); });
}
