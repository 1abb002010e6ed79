// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What samples of a camera's resolution, along paths through its image, say of each entry of its profile.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "../config.hpp"
#include "resolution_profile.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Lower bounds of the squared resolution, one for each entry of a profile.
class resolution_rings {
 public:
  static constexpr int entries = resolution_profile::entries;  ///< as the profile has

  /// \param reach  how far an entry holds beyond its ring, rad
  explicit resolution_rings(double reach) {
    for (int i = 0; i < entries; ++i) {
      from_[i] = std::max(std::acos(1 - i / 16.0) - reach, 0.0);
      to_[i] = std::min(std::acos(1 - (i + 1) / 16.0) + reach, pi);
      bound_[i] = none;
    }
  }

  struct sample {
    double angle;    ///< to the optical axis, rad
    double squared;  ///< squared resolution; < 0: no keypoint is there
  };
  /// Lowers the bound of every entry that a step of the path is in: to the samples at both of its ends, less `share` of the
  /// resolution for what is between, or a quarter of what they differ from those beside them if that is more. (The least of
  /// a parabola is below the nearest sample by an eighth of that at most.)
  void add(const std::vector<sample>& path, double share) {
    const double squared_share = 1 - (1 - share) * (1 - share);
    double before = none;
    for (std::size_t k = 0; k < path.size(); ++k) {
      double less = squared_share * path[k].squared;
      for (const std::size_t beside : {k == 0 ? k : k - 1, k + 1 == path.size() ? k : k + 1})
        if (path[beside].squared >= 0) less = std::max(less, std::abs(path[k].squared - path[beside].squared) / 4);
      const double here = path[k].squared < 0 ? none : path[k].squared - less, least = std::min(before, here);
      before = here;
      if (k == 0 || !(least < none)) continue;
      const double low = std::min(path[k - 1].angle, path[k].angle), high = std::max(path[k - 1].angle, path[k].angle);
      for (auto i = std::upper_bound(to_, to_ + entries, low) - to_; i < entries && from_[i] < high; ++i)
        bound_[i] = std::min(bound_[i], least);
    }
  }

  /// Angles from 0 to pi: a degree apart, and where entries begin and end, so that none is measured beyond what it holds for.
  std::vector<double> angles() const {
    std::vector<double> result(from_, from_ + entries);
    result.insert(result.end(), to_, to_ + entries);
    for (int degree = 0; degree <= 180; ++degree) result.push_back(degree * pi / 180);
    std::sort(result.begin(), result.end());
    result.erase(std::unique(result.begin(), result.end()), result.end());
    return result;
  }
  /// Whether a sample is in entry i.
  bool measured(int i) const { return bound_[i] < none; }
  /// Of entry i, px / rad.
  double bound(int i) const { return std::sqrt(std::max(bound_[i], 0.0)); }

 private:
  static constexpr double pi = 3.141592653589793, none = 1e300;

  double from_[entries], to_[entries], bound_[entries];
};

}  // namespace detail

TURBOMAP_END_NAMESPACE
